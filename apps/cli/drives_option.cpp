#include <dashpot/apps/cli/drives_option.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/input_error.hpp>

namespace dashpot::apps {

void take_drives(const std::string& name, controller::ModelOptions& model) try {
  if (!name.empty()) controller::find_drives(name);
  model.drives = name;
} catch (const controller::InvalidModel& error) {
  throw controller::InputError("--drives", error.what());
}

}  // namespace dashpot::apps
