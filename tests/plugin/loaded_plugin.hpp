#pragma once
// The plugin for a host without Dashpot's headers for C++: loaded at run time.

#include <dashpot/controller/plugin.h>
#include <dashpot/tests/plugin/config_file.hpp>
#include <dashpot/tests/support/places.hpp>

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace dashpot::tests {

inline void* plugin_library() {
  static void* const library = dlopen(DASHPOT_PLUGIN, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw std::runtime_error(dlerror());
  return library;
}

using PluginInterface = const dashpot_plugin* (*)(uint32_t);

inline PluginInterface plugin_interface() {
  void* const symbol = dlsym(plugin_library(), "dashpot_plugin_interface");
  if (symbol == nullptr) throw std::runtime_error(dlerror());
  return reinterpret_cast<PluginInterface>(symbol);
}

inline const dashpot_plugin& plugin() {
  static const dashpot_plugin& functions = *plugin_interface()(DASHPOT_PLUGIN_VERSION);
  return functions;
}

struct Destroy {
  void operator()(dashpot_controller* controller) const { plugin().destroy(controller); }
};
using Handle = std::unique_ptr<dashpot_controller, Destroy>;

/// Returns a struct with only its size set.
template <class Struct>
Struct sized() {
  Struct result{};
  result.struct_size = sizeof result;
  return result;
}

/// Gains of an arm of seven joints, all of them NULL.
inline dashpot_gains panda_gains() {
  auto gains = sized<dashpot_gains>();
  gains.joints = 7;
  return gains;
}

/// A controller configured by `text`, which is null if the plugin refuses.
inline Handle create(const std::string& text) {
  const Scratch scratch;
  return Handle(plugin().create(scratch.write("arm.yaml", text).c_str()));
}

/// A host's data of one arm: its state, and the targets of the C structs' pointers.
struct Host {
  explicit Host(Handle handle, const std::vector<double>& start)
      : controller(std::move(handle)),
        position(start),
        velocity(start.size()),
        torque(start.size()) {}

  std::uint32_t n() const { return static_cast<std::uint32_t>(position.size()); }
  dashpot_state state() const {
    return {sizeof(dashpot_state), n(), time, position.data(), velocity.data(), nullptr};
  }
  dashpot_output output() { return {sizeof(dashpot_output), n(), torque.data()}; }
  /// One tick, a millisecond after the last.
  std::int32_t tick(const dashpot_setpoint* setpoint = nullptr) {
    time += 1'000'000;
    const dashpot_state now = state();
    dashpot_output out = output();
    return plugin().update(controller.get(), &now, setpoint, &out);
  }
  dashpot_setpoint joint_setpoint(const std::vector<double>& goal,
                                  std::int64_t when = DASHPOT_ON_ARRIVAL) const {
    return {sizeof(dashpot_setpoint),
            n(),
            when,
            DASHPOT_MODE_JOINT,
            goal.data(),
            nullptr,
            nullptr,
            nullptr};
  }
  dashpot_snapshot snapshot() const {
    auto result = sized<dashpot_snapshot>();
    EXPECT_EQ(plugin().read_snapshot(controller.get(), &result), DASHPOT_OK);
    return result;
  }
  dashpot_modes modes() const {
    auto result = sized<dashpot_modes>();
    EXPECT_EQ(plugin().read_modes(controller.get(), &result), DASHPOT_OK);
    return result;
  }

  Handle controller;
  std::int64_t time = 1'000'000'000'000;
  std::vector<double> position;
  std::vector<double> velocity;
  std::vector<double> torque;
};

/// Away from limits and singularities.
inline const std::vector<double>& panda_posture() {
  static const std::vector<double> posture = {0, -0.785, 0, -2.356, 0, 1.571, 0.785};
  return posture;
}

}  // namespace dashpot::tests
