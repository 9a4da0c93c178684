#pragma once
// The default gains of public controllers.

#include <array>
#include <string_view>

namespace dashpot::apps {

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
