#pragma once
// The default gains of public controllers.
#include <dashpot/apps/cli/arm_option.hpp>
#include <dashpot/controller/audit.hpp>

#include <CLI/App.hpp>
#include <array>
#include <optional>
#include <string>
#include <string_view>
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

/// Springs and dampers in all joints of a Panda, without a projector, and the dampers of the tip.
struct JointGains {
  std::array<double, 7> stiffness, damping;  ///< N m/rad, N m s/rad
  double translation, rotation;              ///< of the tip's dampers, N s/m, N m s/rad
};

/// Default gains of a Cartesian impedance controller. Without `joints` its documentation calls them
/// critically damped: D = 2 sqrt(K), in the null space as well, where they act through the
/// projector of the pseudo-inverse.
struct GainPreset {
  std::string_view name;
  double translation;    ///< N/m, or 1/s^2 with `inertia_blocks`
  double rotation;       ///< N m/rad, or 1/s^2
  double null_space;     ///< of each joint, N m/rad
  bool half_quaternion;  ///< the rotational error is the vector part of a quaternion
  bool inertia_blocks;   ///< gains are multiplied by the tip's inertia
  const JointGains* joints = nullptr;
};

inline constexpr double kPresetFactor = 2;

inline constexpr JointGains kPolymetis = {
    {40, 30, 50, 25, 35, 25, 10}, {4, 6, 5, 5, 3, 2, 1}, 37, 2};

inline constexpr std::array<GainPreset, 8> kPresets = {{
    // libfranka, examples/cartesian_impedance_control.cpp
    {"libfranka", 150, 10, 0, true, false},
    // franka_ros, franka_example_controllers/cfg/compliance_param.cfg
    {"franka_ros", 200, 20, 0, true, false},
    // panda-py, src/controllers/cartesian_impedance.cpp
    {"panda_py", 600, 30, 0.5, true, false},
    // utiasDSL/crisp_controllers, parameters of the Cartesian controller
    {"crisp", 500, 30, 1, false, false},
    // matthias-mayr/Cartesian-Impedance-Controller, default stiffness; error as an angle and axis
    {"cartesian_impedance_controller", 200, 20, 0, false, false},
    // TimSchneider42/franky, defaults of CartesianImpedanceMotion
    {"franky", 1200, 80, 10, false, false},
    // UT-Austin-RPL/deoxys_control, deoxys/config/osc-pose-controller.yml, without its
    // residual_mass_vec; the law is in deoxys/franka-interface/src/controllers/osc_impedance.cpp
    {"deoxys", 150, 250, 0, true, true},
    // facebookresearch/fairo, polymetis/polymetis/conf/robot_client/franka_hardware.yaml; the law
    // is HybridJointSpacePD of torchcontrol
    {"polymetis", 750, 15, 0, false, false, &kPolymetis},
}};

}  // namespace dashpot::apps
