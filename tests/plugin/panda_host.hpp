#pragma once
// A Panda behind the C interface, and how it moves.

#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/plugin/loaded_plugin.hpp>

#include <Eigen/Cholesky>
#include <string>
#include <vector>

namespace dashpot::tests {

inline constexpr const char* kCartesian = "control: {mode: cartesian}\n";

inline controller::JointVector joint_vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Moves the arm of `model` for one period under the host's torque.
inline void simulate(const controller::RobotModel& model, Host& host, double period = 0.001) {
  const controller::JointVector q = joint_vector(host.position);
  const controller::JointVector qd = joint_vector(host.velocity);
  const auto robot = controller::evaluate(model, q, qd);
  const Eigen::VectorXd force = joint_vector(host.torque) - robot.coriolis - robot.gravity;
  const Eigen::MatrixXd M = robot.M;
  const Eigen::VectorXd velocity = qd + period * M.llt().solve(force);
  Eigen::Map<Eigen::VectorXd>(host.velocity.data(), velocity.size()) = velocity;
  Eigen::Map<Eigen::VectorXd>(host.position.data(), velocity.size()) = q + period * velocity;
}

/// Ticks with this set-point, after each of which the arm moves; all must succeed.
inline void run_simulated(const controller::RobotModel& model, Host& host, int ticks,
                          const dashpot_setpoint* setpoint = nullptr) {
  for (int tick = 0; tick < ticks; ++tick) {
    ASSERT_EQ(host.tick(setpoint), DASHPOT_OK) << "tick " << tick;
    simulate(model, host);
  }
}

/// A Panda whose joints start with their gravity torque.
inline Host panda_host(const std::string& settings = "") {
  Host host(create(panda() + settings), panda_posture());
  const auto model = load(panda() + settings).model;
  const controller::JointVector q = joint_vector(panda_posture());
  const Eigen::VectorXd gravity =
      controller::evaluate(model, q, controller::JointVector::Zero(7)).gravity;
  EXPECT_EQ(plugin().reset(host.controller.get(), gravity.data()), DASHPOT_OK);
  return host;
}

}  // namespace dashpot::tests
