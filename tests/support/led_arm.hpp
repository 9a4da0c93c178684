#pragma once
// An arm that is led along a path, whatever its controller wants: nothing but its state matters.

#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/constant_damping.hpp>

#include <cmath>
#include <numbers>

namespace dashpot::testing {

/// An arm without friction.
inline controller::RobotModel smooth_arm(const Arm& arm) {
  controller::ModelOptions options;
  options.viscous_friction = Eigen::VectorXd::Zero(arm_model(arm).dof());
  return arm_model(arm, options);
}

inline controller::RobotModel smooth_panda() {
  return smooth_arm(arms()[0]);
}

/// Settings in which no limit or watchdog interferes.
inline controller::Settings without_limits(controller::Settings settings) {
  settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
  settings.watchdog.feedback = 0;
  settings.analysis.share = 1;
  settings.limits.beyond_model = true;
  settings.limits.velocity.setConstant(1e3);
  settings.limits.tip_velocity = 1e3;
  settings.limits.position_lower.setConstant(-10);
  settings.limits.position_upper.setConstant(10);
  return settings;
}

inline controller::Settings unlimited_settings(const controller::RobotModel& model) {
  return without_limits(constant_damping(model));
}

inline controller::Settings in_mode(controller::Settings settings, controller::Mode mode) {
  settings.initial.mode = mode;
  return settings;
}

/// Settings where nothing acts but springs, and dampers that hold a ratio of 0.7.
inline controller::Settings plain_settings(const controller::RobotModel& model,
                                           controller::Mode mode) {
  controller::Settings settings = in_mode(unlimited_settings(model), mode);
  settings.feed_forward = {false, false, false, false, false};
  controller::Gains& gains = settings.initial.gains;
  gains.null_stiffness.setZero();
  gains.null_damping.setZero();
  gains.task_damping_ratio = gains.joint_damping_ratio = 0.7;
  gains.task_stiffness = controller::Vector6(2000, 600, 2000, 100, 100, 100).asDiagonal();
  return settings;
}

inline constexpr double kSmallSwing = 0.2;  // rad

inline std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

struct LedArm {
  /// Swings by `amplitude`, rad.
  LedArm(const controller::RobotModel& robot, const controller::Settings& settings,
         double amplitude = 0.4)
      : model(robot),
        controller(robot, settings),
        setpoint(settings.initial),
        swings_by(amplitude) {
    center = controller::JointVector::LinSpaced(model.dof(), 0.3, 1.2);
    if (model.dof() == 7) center << 0, -0.785, 0.1, -2.2, 0.2, 1.7, 0.785;
    place(center);
    const auto there = controller::evaluate(model, center, state.velocity);
    setpoint.joint_position = center;
    setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  }
  /// At rest.
  void place(const controller::JointVector& q) {
    state.position = q;
    state.velocity = controller::JointVector::Zero(q.size());
  }
  /// Swings to the place of time t, one swing in 2 s.
  void swing(double t) {
    for (Eigen::Index i = 0; i < center.size(); ++i) {
      const auto shift = static_cast<double>(i);
      const double phase = std::numbers::pi * t + shift;
      state.position[i] = center[i] + swings_by * (std::sin(phase) - std::sin(shift));
      state.velocity[i] = swings_by * std::numbers::pi * std::cos(phase);
    }
  }
  controller::Status tick() {
    setpoint.time = state.time += 1'000'000;
    return controller.update(state, setpoint, torque);
  }
  /// Until the gains have grown.
  void settle() {
    const int ticks = static_cast<int>(controller.settings().motion.gain_time * 1000) + 2;
    for (int k = 0; k < ticks; ++k) tick();
  }
  const controller::Vibration& modes() const { return controller.vibration(); }
  /// C of the closed loop, n x n.
  Eigen::MatrixXd damping() const {
    analysis::System<controller::kMaxJoints> system;
    controller.closed_loop(system);
    return system.damping;
  }

  controller::RobotModel model;
  controller::Controller controller;
  controller::RobotState state;
  controller::Setpoint setpoint;
  controller::JointVector center, torque;
  double swings_by;
};

}  // namespace dashpot::testing
