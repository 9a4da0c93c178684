#pragma once
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/robot_model.hpp>

#include <CLI/CLI.hpp>
#include <string>

namespace dashpot::apps {

inline constexpr const char* kDrivesHelp =
    "Public figures of it, with source and doubt in dashpot inspect: panda, fr3, iiwa14, ur5e, "
    "...; "
    "or a file of dashpot calibrate";

/// Gives the model the published drives, or the drives file with its friction, of this name unless
/// it is empty. Throws InputError with the option --drives.
void take_drives(const std::string& name, controller::ModelOptions& model);

/// Adds the flag --accept-inertias to a command; `accepted` becomes "true", or the links given as
/// in --accept-inertias=hand,finger.
void add_accept_inertias(CLI::App& command, std::string& accepted);
/// Makes the model accept these inertias.
void take_accepted(const std::string& accepted, controller::ModelOptions& model);

/// Prints doubts about the description of the arm on a terminal.
void warn_of(const controller::RobotModel& model);
/// Prints doubts about gains on a terminal.
void warn_of(const controller::RobotModel& model, const controller::Gains& gains);
/// Prints doubts about the arm and gains of a configuration on a terminal.
void warn_of(const controller::Config& config);

/// Elastic gears; lists of quantities between commas, or one for all joints.
struct GearOptions {
  std::string stiffness;        ///< N m/rad; "none": rigid
  std::string damping;          ///< N m s/rad
  std::string position_sensor;  ///< motor or link; empty: motor

  bool any() const { return !stiffness.empty() || !damping.empty() || !position_sensor.empty(); }
};

/// Adds --gear-stiffness, --gear-damping and --position-sensor.
void add_gear_options(CLI::App& command, GearOptions& options);

/// Gives `model` the gears of an arm with the joints of `plain`. Throws InputError.
void take_gears(const GearOptions& options, const controller::RobotModel& plain,
                controller::ModelOptions& model);

/// Refuses the name "".
CLI::Validator not_empty();

/// Returns the error of a model in terms of the command-line options.
controller::InputError model_error(const controller::InvalidModel& error);

}  // namespace dashpot::apps
