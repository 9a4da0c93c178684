#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/settings.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>

namespace dashpot::apps {

/// The goal of the tip in the directions `selected` (1 or 0 each) in the axes R.
struct TipGoal {
  controller::Pose pose;
  controller::Vector6 selected = controller::Vector6::Ones();
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();

  /// Returns the distance of `tip` from the goal in the selected directions: m, and a rotation
  /// vector in rad; base axes.
  controller::Vector6 miss(const controller::DynamicsResult& tip) const {
    controller::Vector6 error;
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(pose.rotation * tip.R_BT.transpose()));
    error << pose.position - tip.p_BT_B, turn.angle() * turn.axis();
    return controller::part_along(selected, R, error);
  }
};

/// The goal's miss at the nearest position within the position limits that a descent from `q`
/// finds: Levenberg and Marquardt's, with joints that would leave their limits held there.
inline controller::Vector6 descend(const controller::RobotModel& model,
                                   const controller::Limits& limits, const TipGoal& goal,
                                   controller::JointVector q) {
  constexpr int kSteps = 100;
  constexpr double kExact = 1e-9;
  const Eigen::Index n = q.size();
  const controller::JointVector still = controller::JointVector::Zero(n);
  controller::DynamicsResult robot = controller::evaluate(model, q, still);
  controller::Vector6 miss = goal.miss(robot);
  double damping = 1e-3;
  for (int step = 0; step < kSteps && miss.norm() > kExact && damping < 1e6; ++step) {
    Eigen::MatrixXd J(6, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      J.col(j) = controller::part_along(goal.selected, goal.R, robot.J.col(j));
    }
    const Eigen::VectorXd downhill = J.transpose() * miss;
    for (Eigen::Index j = 0; j < n; ++j) {
      const bool out =
          downhill[j] > 0 ? q[j] >= limits.position_upper[j] : q[j] <= limits.position_lower[j];
      if (out) J.col(j).setZero();
    }
    const Eigen::MatrixXd A = J * J.transpose() + damping * Eigen::MatrixXd::Identity(6, 6);
    const controller::JointVector next = (q + J.transpose() * A.llt().solve(miss))
                                             .cwiseMax(limits.position_lower)
                                             .cwiseMin(limits.position_upper);
    const controller::DynamicsResult there = controller::evaluate(model, next, still);
    const controller::Vector6 left = goal.miss(there);
    if (left.norm() < miss.norm()) {
      q = next;
      robot = there;
      miss = left;
      damping = std::max(1e-9, 0.1 * damping);
    } else {
      damping *= 10;
    }
  }
  return miss;
}

/// The distance from the goal at the nearest position found within the limits, from `q` and from
/// postures all over the range: zero, to 1e-6 m and rad, if the arm reaches the goal.
inline controller::Vector6 out_of_reach_by(const controller::RobotModel& model,
                                           const controller::Limits& limits, const TipGoal& goal,
                                           const controller::JointVector& q) {
  constexpr int kPostures = 32;
  constexpr double kThere = 1e-6;
  controller::Vector6 least = descend(model, limits, goal, q);
  const controller::PostureSequence postures(limits.position_lower, limits.position_upper);
  for (int k = 0; k < kPostures && least.norm() > kThere; ++k) {
    const controller::Vector6 miss = descend(model, limits, goal, postures.at(k));
    if (miss.norm() < least.norm()) least = miss;
  }
  return least.norm() > kThere ? least : controller::Vector6(controller::Vector6::Zero());
}

}  // namespace dashpot::apps
