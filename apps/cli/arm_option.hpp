#pragma once
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/robot_model.hpp>

#include <CLI/App.hpp>
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

/// The projector of the null space, as options give it.
struct ProjectorOption {
  std::string name;     ///< empty: another source says it
  std::string weights;  ///< n positive numbers, or one for all joints

  void add(CLI::App& command);
  /// Sets what the options say.
  void take(const controller::RobotModel& model, controller::NullProjector& projector,
            controller::JointVector& W) const;
};

/// An arm at one configuration, as the options of `dashpot design --urdf` and `dashpot audit` give
/// it; lists of quantities between commas.
struct ArmOptions {
  std::string urdf, base, tip;
  PostureOption posture;
  std::string joint_stiffness;  ///< of springs in the joints instead, n or one; N m/rad
  std::string task_stiffness;   ///< diagonal of K_C, 6: linear, then angular; N/m, N m/rad
  std::string task_damping;     ///< diagonal of C_C before, 6; none if empty
  // Further properties, none if empty; n numbers, or one for all joints
  std::string viscous_friction;   ///< N m s/rad, or "urdf" or "drives" for what these have
  std::string null_stiffness;     ///< of the motions that the task leaves free, N m/rad
  std::string null_damping;       ///< of the same, N m s/rad
  ProjectorOption projector;      ///< through which these act
  std::string gravity;            ///< in the axes of the root link, m/s^2
  std::string reflected_inertia;  ///< kg m^2
  std::string drives;             ///< name of public figures
  GearOptions gears;
  /// Mass at the tip, its center, and its inertia about that: m, or m,x,y,z, or with
  /// xx,yy,zz[,xy,xz,yz]; kg, m, kg m^2.
  std::string payload;

  std::string accept_inertias;  ///< although impossible for a body, see take_accepted

  bool any() const;  ///< whether any option except `urdf` is given
};

/// Adds --payload to a command.
void add_payload(CLI::App& command, std::string& payload);
/// Reads a payload. Throws InputError.
controller::Payload read_payload(const std::string& text);

/// The arm with its payload, reflected inertia, and the friction that counts. Throws InputError.
controller::RobotModel read_model(const ArmOptions& options);

/// Returns a sentence on the friction that counts or is left out; empty if there is none.
std::string friction_note(const ArmOptions& options, const controller::RobotModel& model);

/// The arm with its springs at q, as a file would give it: mass, jacobian (6 x n, base-aligned axes
/// at the tip), task_stiffness, task_damping, and the damping by friction and in the null space; or
/// stiffness alone for springs in the joints. Throws InputError.
SystemEntry read_arm(const ArmOptions& options, const controller::RobotModel& model,
                     const controller::JointVector& q);

/// Adds the options of the arm's inertia and friction: reflected inertia, payload and so on.
void add_model_options(CLI::App& command, ArmOptions& arm);

/// Adds the options of the null space.
void add_null_space_options(CLI::App& command, ArmOptions& arm);
/// Sets the gains of the null space and the projector that the options name.
void take_null_space(const ArmOptions& options, const controller::RobotModel& model,
                     controller::AuditOptions& stated);

/// Adds the options of a loop except its period.
void add_loop_options(CLI::App& command, controller::LoopTiming& timing);
bool given(const controller::LoopTiming& timing);

}  // namespace dashpot::apps
