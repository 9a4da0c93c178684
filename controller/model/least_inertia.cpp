#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/model/least_inertia.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
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

/// A golden-ratio sequence of postures.
class Postures {
 public:
  Postures(const JointVector& lower, const JointVector& upper)
      : lower_(lower.cwiseMax(-std::numbers::pi)), upper_(upper.cwiseMin(std::numbers::pi)) {
    for (Eigen::Index i = 0; i < lower.size(); ++i) {  // limits that are all beyond half a turn
      if (lower_[i] <= upper_[i]) continue;
      if (lower[i] > 0) {  // the other limit may be infinite
        upper_[i] = std::min(upper[i], lower[i] + 2 * std::numbers::pi);
      } else {
        lower_[i] = std::max(lower[i], upper[i] - 2 * std::numbers::pi);
      }
    }
  }

  JointVector next() {
    JointVector q = lower_;
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      share_ += 0.6180339887498949;
      share_ -= std::floor(share_);
      q[i] += share_ * (upper_[i] - lower_[i]);
    }
    return q;
  }

 private:
  JointVector lower_, upper_;
  double share_ = 0;  // in [0, 1)
};

}  // namespace

TipInertia least_tip_inertia(const RobotModel& model, const JointVector& lower,
                             const JointVector& upper) {
  double mobility_linear = 0, mobility_angular = 0;
  Postures postures(lower, upper);
  for (int k = 0; k < 64; ++k) {
    const DynamicsResult robot = evaluate(model, postures.next(), JointVector::Zero(model.dof()));
    const Eigen::MatrixXd M = robot.M, J = robot.J;
    const Eigen::MatrixXd A = J * factored(M).solve(J.transpose());
    mobility_linear = std::max(mobility_linear, A.topLeftCorner<3, 3>().trace());
    mobility_angular = std::max(mobility_angular, A.bottomRightCorner<3, 3>().trace());
  }
  return {1 / mobility_linear, 1 / mobility_angular};
}

JointVector least_joint_inertia(const RobotModel& model, const JointVector& lower,
                                const JointVector& upper) {
  constexpr int kPostures = 256;
  const int n = model.dof();
  Postures postures(lower, upper);
  std::vector<Eigen::MatrixXd> masses;
  Eigen::VectorXd mobility = Eigen::VectorXd::Zero(n);
  for (int k = 0; k < kPostures; ++k) {
    masses.emplace_back(evaluate(model, postures.next(), JointVector::Zero(n)).M);
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
