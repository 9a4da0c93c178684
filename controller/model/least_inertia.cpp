#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/model/posture_sequence.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <vector>

namespace dashpot::controller {
namespace {

/// Throws InvalidModel unless M is positive definite.
Eigen::LLT<Eigen::MatrixXd> factored(const Eigen::MatrixXd& M) {
  Eigen::LLT<Eigen::MatrixXd> llt(M);
  if (llt.info() == Eigen::Success) return llt;
  throw InvalidModel(
      "the mass matrix is not positive definite in some posture: a link has an inertia that no "
      "body has");
}

}  // namespace

TipInertia least_tip_inertia(const RobotModel& model, const JointVector& lower,
                             const JointVector& upper) {
  double mobility_linear = 0, mobility_angular = 0;
  const PostureSequence postures(lower, upper);
  for (int k = 0; k < 64; ++k) {
    const DynamicsResult robot = evaluate(model, postures.at(k), JointVector::Zero(model.dof()));
    const Eigen::MatrixXd M = robot.M, J = robot.J;
    const Eigen::MatrixXd A = J * factored(M).solve(J.transpose());
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

JointVector least_joint_inertia(const RobotModel& model, const JointVector& lower,
                                const JointVector& upper) {
  constexpr int kPostures = 1024;
  const int n = model.dof();
  const PostureSequence postures(lower, upper);
  std::vector<Eigen::MatrixXd> masses;
  Eigen::VectorXd mobility = Eigen::VectorXd::Zero(n);
  for (int k = 0; k < kPostures; ++k) {
    masses.emplace_back(evaluate(model, postures.at(k), JointVector::Zero(n)).M);
    const Eigen::MatrixXd inverse = factored(masses.back()).solve(Eigen::MatrixXd::Identity(n, n));
    mobility = mobility.cwiseMax(inverse.diagonal());
  }
  const Eigen::VectorXd inertia = mobility.cwiseInverse();
  double largest = 1;  // eigenvalue of M^-1 diag(inertia)
  for (const Eigen::MatrixXd& M : masses) {
    const Eigen::MatrixXd L = factored(M).matrixL();
    const Eigen::MatrixXd half =
        L.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd(inertia.cwiseSqrt().asDiagonal()));
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(half * half.transpose(),
                                                                Eigen::EigenvaluesOnly);
    largest = std::max(largest, solver.eigenvalues().maxCoeff());
  }
  return inertia / largest;
}

}  // namespace dashpot::controller
