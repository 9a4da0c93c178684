#pragma once
#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/controller/audit.hpp>

#include <CLI/App.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// The command line of `dashpot audit`, as text where the robot has to be known first.
struct AuditCommand {
  ArmOptions arm;  ///< but for the task's stiffness and damping
  std::string preset, gains, mode;
  std::string stiffness, damping;              ///< 6 each
  std::string joint_stiffness, joint_damping;  ///< n each, or one number
  std::string null_stiffness, null_damping;    ///< the same
  std::string null_projector;
  std::optional<double> damping_factor;
  std::string rotation, frame;
  controller::LoopTiming timing;
  bool no_margin = false;
  double margin = 2;
  PosturesOption postures;
  std::optional<double> damping_ratio;  ///< wanted of the suggestion
  int jobs = 0;                         ///< 0: one for each processor
  std::string csv, plot;
  bool json = false;
};

/// What is to be audited.
struct AuditTask {
  controller::RobotModel model;
  controller::AuditOptions options;
  /// The ratio that the gains were meant to give, F/2; NaN if they do not say.
  double intended_ratio;
  double wanted_ratio;  ///< of the suggestion
  controller::JointVector q;
  std::vector<controller::JointVector> postures;  ///< of the file or log; empty if there is none
  std::string friction = {};  ///< what counts of it, or is left out; empty: there is none
  std::string drives = {};    ///< name of the published drives that the model has
};

/// Adds the options of arm, gains, loop and postures to a subcommand, and --json; they are written
/// to `options`.
void add_stated_options(CLI::App& command, AuditCommand& options);
/// Adds these and the other options of `dashpot audit`.
void add_audit_options(CLI::App& command, AuditCommand& options);

/// Throws InputError for options that do not go together, and for what is wrong in one of them.
AuditTask read_task(const AuditCommand& command);

}  // namespace dashpot::apps
