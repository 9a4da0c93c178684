#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/posture.hpp>

#include <Eigen/Cholesky>
#include <algorithm>

namespace dashpot::controller {

TipInertia least_tip_inertia(const RobotModel& model, const JointVector& lower,
                             const JointVector& upper) {
  double mobility_linear = 0, mobility_angular = 0;
  const PostureSequence postures(lower, upper);
  for (int k = 0; k < 64; ++k) {
    const DynamicsResult robot = evaluate(model, postures.at(k), JointVector::Zero(model.dof()));
    const Eigen::MatrixXd M = robot.M, J = robot.J;
    const Eigen::LLT<Eigen::MatrixXd> factor(M);
    if (factor.info() != Eigen::Success) {
      throw InvalidModel(
          "the mass matrix is not positive definite in some posture: a link has an inertia that no "
          "body has");
    }
    const Eigen::MatrixXd A = J * factor.solve(J.transpose());
    mobility_linear = std::max(mobility_linear, A.topLeftCorner<3, 3>().trace());
    mobility_angular = std::max(mobility_angular, A.bottomRightCorner<3, 3>().trace());
  }
  return {1 / mobility_linear, 1 / mobility_angular};
}

RobotModel unloaded(const RobotModel& model) try {
  Attachment nothing;
  nothing.tool = model.attachment().tool;
  return model.attachment().mass > 0 ? model.with(nothing) : model;
} catch (const InvalidModel&) {
  return model;
}

}  // namespace dashpot::controller
