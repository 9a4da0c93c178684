#pragma once
// A plugin of any version from 4 on, as a host loads it that does not ask for its table of
// functions.

#include <dashpot/controller/plugin.h>
#include <dashpot/tests/support/places.hpp>

#include <dlfcn.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace dashpot::stress {

/// The functions of a plugin file whose C interface has stayed what it was since version 4.
class PluginFile {
 public:
  PluginFile(std::string label_text, const std::string& path) : label(std::move(label_text)) {
    // Its functions call each other, and not the plugin that the program links with.
    void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
    if (library == nullptr) throw std::runtime_error(dlerror());
    find(library, "dashpot_create", create);
    find(library, "dashpot_destroy", destroy);
    find(library, "dashpot_update", update);
    find(library, "dashpot_reset", reset);
    find(library, "dashpot_set_setpoint", set_setpoint);
    find(library, "dashpot_set_gains", set_gains);
    find(library, "dashpot_last_error", last_error);
    find(library, "dashpot_status_text", status_text);
  }

  std::string label;  ///< "before", "after"
  decltype(&dashpot_create) create = nullptr;
  decltype(&dashpot_destroy) destroy = nullptr;
  decltype(&dashpot_update) update = nullptr;
  decltype(&dashpot_reset) reset = nullptr;
  decltype(&dashpot_set_setpoint) set_setpoint = nullptr;
  decltype(&dashpot_set_gains) set_gains = nullptr;
  decltype(&dashpot_last_error) last_error = nullptr;
  decltype(&dashpot_status_text) status_text = nullptr;

 private:
  template <class Function>
  static void find(void* library, const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(library, name));
    if (function == nullptr) throw std::runtime_error(dlerror());
  }
};

}  // namespace dashpot::stress
