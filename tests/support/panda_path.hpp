#pragma once
// A Franka Panda arm under Cartesian impedance control, moving.

#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/arms.hpp>

#include <cmath>
#include <numbers>

namespace dashpot::testing {

struct ArmModel {
  Eigen::MatrixXd mass;      ///< 7 x 7, kg m^2
  Eigen::MatrixXd jacobian;  ///< 6 x 7, of the hand's tool centre point in base axes, linear first
};

inline ArmModel panda(const Eigen::VectorXd& q) {
  static const controller::RobotModel model = panda_model();
  const auto there = evaluate(model, q, controller::JointVector::Zero(7));
  return {0.5 * (there.M + there.M.transpose()), there.J};
}

/// K_C = diag(3000, 3000, 3000, 100, 100, 100) N/m and N m/rad, and C_C of damping ratio `ratio` on
/// unit masses as is often seen, 2 ratio sqrt(K_C); W = K_C^1/2 J and C = J' C_C J.
inline analysis::System<analysis::kMaxDof> panda_impedance(const Eigen::VectorXd& q, double ratio) {
  const ArmModel arm = panda(q);
  Eigen::VectorXd K_C(6);
  K_C << 3000, 3000, 3000, 100, 100, 100;
  const Eigen::VectorXd C_C = 2 * ratio * K_C.cwiseSqrt();
  analysis::System<analysis::kMaxDof> system(7);
  system.mass = arm.mass;
  const Eigen::MatrixXd CJ = C_C.cwiseSqrt().asDiagonal() * arm.jacobian;
  const Eigen::MatrixXd damping = CJ.transpose() * CJ;
  system.damping = 0.5 * (damping + damping.transpose());
  system.stiffness_factor = K_C.cwiseSqrt().asDiagonal() * arm.jacobian;
  const Eigen::MatrixXd stiffness = system.stiffness_factor.transpose() * system.stiffness_factor;
  system.stiffness = 0.5 * (stiffness + stiffness.transpose());
  return system;
}

/// Joint positions at time t (s): each joint swings by 0.5 rad about a usual pose, with periods of
/// 2 to 5 seconds.
inline Eigen::VectorXd swing(double t) {
  Eigen::VectorXd q(7);
  q << 0, -0.785398, 0, -2.356194, 0, 1.570796, 0.785398;
  for (Eigen::Index i = 0; i < 7; ++i) {
    const double period = 2 + 0.5 * static_cast<double>(i);
    q[i] += 0.5 * std::sin(2 * std::numbers::pi * t / period + static_cast<double>(i));
  }
  return q;
}

}  // namespace dashpot::testing
