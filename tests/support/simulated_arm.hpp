#pragma once
// A controlled arm for tests: integrates the equations of motion between two ticks.

#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/constant_damping.hpp>

#include <Eigen/Cholesky>
#include <string>

namespace dashpot::testing {

/// Settings of the Panda in which nothing but what a test asks for interferes.
inline controller::Settings quiet_settings(const controller::RobotModel& model) {
  controller::Settings settings = constant_damping(model);
  settings.analysis.where = controller::Analysis::Where::kOff;
  settings.watchdog.feedback = 0;  // many tests put the arm where they want it
  return settings;
}

inline controller::JointVector panda_ready() {
  controller::JointVector q(7);
  q << 0, -0.785398, 0, -2.356194, 0, 1.570796, 0.785398;
  return q;
}

struct SimulatedArm {
  controller::RobotModel model;
  controller::Controller controller;
  controller::RobotState state;
  controller::Setpoint setpoint;
  controller::JointVector torque;
  bool fresh = true;  ///< the set-point's time is renewed at every tick

  SimulatedArm(const controller::RobotModel& robot, const controller::Settings& settings,
               const controller::JointVector& q)
      : model(robot), controller(robot, settings), setpoint(settings.initial) {
    state.time = 1'000'000'000;
    state.position = q;
    state.velocity = controller::JointVector::Zero(q.size());
    torque = state.velocity;
    setpoint.time = state.time;
    setpoint.joint_position = q;
    setpoint.tip_pose = tip();
    // As if the robot had held its weight so far.
    controller.reset(controller::evaluate(model, q, state.velocity).gravity);
  }

  controller::Pose tip() const {
    const auto there = controller::evaluate(model, state.position, state.velocity);
    return {there.p_BT_B, there.R_BT};
  }

  /// A tick, and a period of motion under its torque and the external wrench, by `substeps` steps
  /// of semi-implicit Euler.
  controller::Status step(int substeps = 2) {
    if (fresh) setpoint.time = state.time;
    const controller::Status status = controller.update(state, setpoint, torque);
    const double period = controller.settings().period, h = period / substeps;
    for (int i = 0; i < substeps; ++i) {
      const auto robot = controller::evaluate(model, state.position, state.velocity);
      const Eigen::MatrixXd M = robot.M;
      const Eigen::VectorXd force =
          torque - robot.coriolis - robot.gravity + robot.J.transpose() * state.external_wrench;
      state.velocity += h * M.llt().solve(force);
      state.position += h * state.velocity;
    }
    state.time += static_cast<std::int64_t>(1e9 * period);
    return status;
  }
};

}  // namespace dashpot::testing
