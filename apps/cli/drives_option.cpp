#include <dashpot/apps/cli/drives_option.hpp>
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <filesystem>
#include <limits>
#include <sstream>

namespace dashpot::apps {

void take_drives(const std::string& name, controller::ModelOptions& model) try {
  model.drives = controller::drives_name(name, std::filesystem::current_path());
  if (!name.empty()) controller::find_drives(model.drives);
  model.drives_friction = controller::has_own_friction(model.drives);
} catch (const controller::InvalidModel& error) {
  throw controller::InputError("--drives", error.what());
}

void add_accept_inertias(CLI::App& command, std::string& accepted) {
  command
      .add_flag("--accept-inertias", accepted,
                "Take impossible inertias as they are: of all links, or of these links only")
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
    print_error("warning: " + warning);
  }
}

void warn_of(const controller::RobotModel& model, const controller::Gains& gains) {
  for (const std::string& doubt : controller::doubtful_gains(model, gains)) {
    print_error("warning: " + doubt);
  }
}

void warn_of(const controller::Config& config) {
  warn_of(config.model);
  for (const std::string& note : config.notes) print_error("note: " + note);
  warn_of(config.model, config.settings.initial.gains);
}

void add_gear_options(CLI::App& command, GearOptions& options) {
  command
      .add_option("--gear-stiffness", options.stiffness,
                  "Of elastic joints, N m/rad; none: rigid. Needs reflected inertia")
      ->option_text("a,b,...|x (none)");
  command.add_option("--gear-damping", options.damping, "Of elastic joints, N m s/rad")
      ->option_text("a,b,...|x (0)");
  command
      .add_option("--position-sensor", options.position_sensor,
                  "Side of the gears where joint positions are measured")
      ->check(CLI::IsMember({"motor", "link"}))
      ->option_text("motor|link (motor)");
}

void take_gears(const GearOptions& options, const controller::RobotModel& plain,
                controller::ModelOptions& model) {
  if (options.stiffness.empty()) {
    if (!options.damping.empty()) {
      throw controller::InputError("--gear-damping", "needs --gear-stiffness, N m/rad");
    }
    if (!options.position_sensor.empty()) {
      throw controller::InputError("--position-sensor", "needs --gear-stiffness, N m/rad");
    }
    return;
  }
  model.gear_stiffness = quantities_per_joint("--gear-stiffness", options.stiffness,
                                              controller::joint_units(plain, "N m/rad", "N/m"),
                                              std::numeric_limits<double>::infinity());
  if (!options.damping.empty()) {
    model.gear_damping = quantities_per_joint("--gear-damping", options.damping,
                                              controller::joint_units(plain, "N m s/rad", "N s/m"));
  }
  if (options.position_sensor == "link") {
    model.position_sensor = controller::PositionSensor::kLink;
  }
}

CLI::Validator not_empty() {
  return {[](const std::string& text) { return std::string(text.empty() ? "is empty" : ""); }, ""};
}

controller::InputError model_error(const controller::InvalidModel& error) {
  const std::string what = error.what();
  return {"", (what.starts_with("drives:") ? "--" : "") + what};
}

}  // namespace dashpot::apps
