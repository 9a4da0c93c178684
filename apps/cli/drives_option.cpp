#include <dashpot/apps/cli/drives_option.hpp>
#include <dashpot/apps/cli/matrix_json.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/input_error.hpp>

#include <cstdio>
#include <sstream>

namespace dashpot::apps {

void take_drives(const std::string& name, controller::ModelOptions& model) try {
  if (!name.empty()) controller::find_drives(name);
  model.drives = name;
} catch (const controller::InvalidModel& error) {
  throw controller::InputError("--drives", error.what());
}

void add_accept_inertias(CLI::App& command, std::string& accepted) {
  command
      .add_flag("--accept-inertias", accepted,
                "Take inertias that no body can have as they are: all, or those of these links")
      ->option_text("[=LINK,...]");
}

void take_accepted(const std::string& accepted, controller::ModelOptions& model) {
  model.accept_inertias = accepted == "true";
  if (accepted.empty() || accepted == "true" || accepted == "false") return;
  std::istringstream names(accepted);
  for (std::string name; std::getline(names, name, ',');) {
    model.accept_inertias_of.push_back(name);
  }
}

void warn_of(const controller::RobotModel& model) {
  for (const std::string& warning : model.warnings()) {
    std::fprintf(stderr, "warning: %s\n", warning.c_str());
  }
}

nlohmann::ordered_json drives_json(const std::string& name) {
  const controller::Drives& drives = controller::find_drives(name);
  return {{"name", drives.name},
          {"reflected_inertia", json_list(drives.values(drives.reflected_inertia))},
          {"viscous_friction", json_list(drives.values(drives.viscous_friction))},
          {"coulomb_friction", json_list(drives.values(drives.coulomb_friction))},
          {"source", drives.source},
          {"doubt", drives.doubt}};
}

CLI::Validator not_empty() {
  return {[](const std::string& text) { return std::string(text.empty() ? "is empty" : ""); }, ""};
}

controller::InputError model_error(const controller::InvalidModel& error) {
  const std::string what = error.what();
  return {"", (what.starts_with("drives:") ? "--" : "") + what};
}

}  // namespace dashpot::apps
