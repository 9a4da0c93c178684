#pragma once
// A robot as the controller and the simulator, which share no code, read it; and postures for it.

#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/sim/robot.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dice.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

namespace dashpot::testing {

/// A robot, as both sides read it from the file: with or without its viscous friction, without
/// Coulomb friction, and with the drives' inertia, which files lack.
struct TwinModels {
  static constexpr double kReflectedInertia = 0.1;  // kg m^2

  controller::RobotModel model;
  sim::Robot robot;

  explicit TwinModels(const Arm& arm, bool friction = true)
      : model(arm_model(arm)), robot(sim::Robot::from_file(arm_path(arm.file), arm.base, arm.tip)) {
    controller::ModelOptions options;
    options.reflected_inertia.setConstant(model.dof(), kReflectedInertia);
    sim::RobotParameters parameters;
    parameters.reflected_inertia = options.reflected_inertia;
    if (!friction) {
      options.viscous_friction = parameters.viscous_friction =
          controller::JointVector::Zero(model.dof());
    }
    model = arm_model(arm, options);
    robot = sim::Robot::from_file(arm_path(arm.file), arm.base, arm.tip, parameters);
  }

  int dof() const { return model.dof(); }
  Eigen::MatrixXd friction() const {
    return Eigen::VectorXd(model.joint_values(&controller::Joint::viscous_friction)).asDiagonal();
  }
  /// dg/dq, n x n, by central differences: good to 1e-9.
  Eigen::MatrixXd gravity_gradient(const controller::JointVector& q) const {
    const controller::JointVector none = controller::JointVector::Zero(q.size());
    Eigen::MatrixXd G(q.size(), q.size());
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      controller::JointVector ahead = q, behind = q;
      ahead[i] += 1e-5;
      behind[i] -= 1e-5;
      G.col(i) =
          (evaluate(model, ahead, none).gravity - evaluate(model, behind, none).gravity) / 2e-5;
    }
    return G;
  }
};

/// Well inside the position limits, and twice as far from a singularity as the controller's
/// NullSpace is exact (TaskInertia::kNearlySingular, in its measure).
inline controller::JointVector random_posture(const TwinModels& twin, Dice& random) {
  const controller::JointVector lower = twin.model.joint_values(&controller::Joint::lower);
  const controller::JointVector upper = twin.model.joint_values(&controller::Joint::upper);
  for (;;) {
    controller::JointVector q(twin.dof());
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      q[i] = random.uniform(std::max(lower[i], -2.5) + 0.2, std::min(upper[i], 2.5) - 0.2);
    }
    const auto robot = evaluate(twin.model, q, controller::JointVector::Zero(q.size()));
    const Eigen::MatrixXd M = robot.M, J = robot.J, A = J * M.llt().solve(J.transpose());
    const Eigen::MatrixXd inverse = A.inverse();
    const double trace =
        A.topLeftCorner<3, 3>().trace() * inverse.topLeftCorner<3, 3>().trace() +
        A.bottomRightCorner<3, 3>().trace() * inverse.bottomRightCorner<3, 3>().trace();
    if (3 / trace > 2e-3) return q;
  }
}

}  // namespace dashpot::testing
