#pragma once
// A Panda whose gains are audited.

#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/places.hpp>

#include <Eigen/Core>
#include <string>

namespace dashpot::controller {

using LongRows = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

inline const Vector6 kTranslationFirst = (Vector6() << 200, 200, 200, 20, 20, 20).finished();

inline RobotModel audited_panda(double friction = 0) {
  ModelOptions options;
  options.viscous_friction = JointVector::Constant(7, friction);
  return RobotModel::from_urdf_file(std::string(DASHPOT_SOURCE_DIR) + "/sim/models/panda.urdf",
                                    "panda_link0", "panda_hand_tcp", options);
}

inline JointVector home() {
  constexpr double kQuarter = 0.78539816339744831;
  JointVector q(7);
  q << 0, -kQuarter, 0, -3 * kQuarter, 0, 2 * kQuarter, kQuarter;
  return q;
}

inline AuditOptions stated(const Vector6& stiffness, double factor) {
  AuditOptions options;
  options.gains.task_stiffness = stiffness.asDiagonal();
  options.gains.task_damping = Vector6(factor * stiffness.cwiseSqrt()).asDiagonal();
  return options;
}

/// The closed loop of task gains as matrices, in long double.
struct TaskLoop {
  LongRows M, C, K;
};

inline TaskLoop loop_at(const RobotModel& model, const JointVector& q, const Matrix6& stiffness,
                        const Matrix6& damping) {
  const DynamicsResult robot = evaluate(model, q, JointVector::Zero(q.size()));
  const LongRows J = Eigen::MatrixXd(robot.J).cast<long double>();
  TaskLoop loop;
  loop.M = Eigen::MatrixXd(robot.M).cast<long double>();
  loop.K = J.transpose() * Eigen::MatrixXd(stiffness).cast<long double>() * J;
  loop.C = J.transpose() * Eigen::MatrixXd(damping).cast<long double>() * J;
  loop.C.diagonal() +=
      Eigen::VectorXd(model.joint_values(&Joint::viscous_friction)).cast<long double>();
  return loop;
}

}  // namespace dashpot::controller
