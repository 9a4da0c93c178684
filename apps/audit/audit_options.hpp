#pragma once
#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/controller/audit.hpp>

#include <CLI/App.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// The command line of `dashpot audit`; what depends on the robot is still text.
struct AuditCommand {
  std::string config;  ///< instead of all that says robot, gains and loop
  ArmOptions arm;      ///< except the task's stiffness and damping
  std::string preset, gains, mode;
  std::string stiffness, damping;              ///< 6 each
  std::string joint_stiffness, joint_damping;  ///< n each, or one number
  std::optional<double> damping_factor;
  std::string rotation, frame;
  controller::LoopTiming timing;
  bool no_margin = false;
  double margin = 2;
  PosturesOption postures;
  std::optional<double> damping_ratio;  ///< that the suggestion must have
  int jobs = 0;                         ///< 0: one for each processor
  std::string csv, plot;
  bool json = false;
};

/// What is to be audited.
struct AuditTask {
  controller::RobotModel model;
  controller::AuditOptions options;
  /// The ratio that the gains were meant to give, F/2; NaN if unknown.
  double intended_ratio;
  double wanted_ratio;  ///< of the suggestion
  controller::JointVector q = {};
  std::vector<controller::JointVector> postures =
      {};                     ///< of the file or log; empty if there is none
  std::string friction = {};  ///< a note on what counts or is left out; empty: no friction
  std::string drives = {};    ///< name of the published drives that the model has

  /// Says where rotors that are unknown can be given.
  std::string rotors_hint() const;
};

/// Adds --json and the options of arm, gains, loop and postures to a subcommand; they are written
/// to `options`. Returns CONFIG, which excludes the options that it replaces.
CLI::Option* add_stated_options(CLI::App& command, AuditCommand& options);
/// Adds these and the other options of `dashpot audit`.
void add_audit_options(CLI::App& command, AuditCommand& options);

/// Throws InputError for an option that is wrong or that excludes another one.
AuditTask read_task(const AuditCommand& command);

}  // namespace dashpot::apps
