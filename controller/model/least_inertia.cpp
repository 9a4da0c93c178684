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

/// Postures spread evenly between the limits of all joints at once, by the sequence of Roberts
/// (2018): joint i advances by phi^-(i + 1) of its range, phi^(n + 1) = phi + 1. One step for all
/// joints would keep the postures on a curve.
class Postures {
 public:
  Postures(const JointVector& lower, const JointVector& upper)
      : lower_(lower.cwiseMax(-std::numbers::pi)),
        upper_(upper.cwiseMin(std::numbers::pi)),
        step_(lower.size()),
        share_(Eigen::VectorXd::Zero(lower.size())) {
    double phi = 1.5;
    const double root = 1.0 / static_cast<double>(lower.size() + 1);
    for (int k = 0; k < 60; ++k) phi = std::pow(phi + 1, root);  // contracts by at least 1/3
    for (Eigen::Index i = 0; i < step_.size(); ++i) {
      step_[i] = std::pow(phi, -static_cast<double>(i + 1));
    }
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
    share_ += step_;
    share_ -= share_.array().floor().matrix().eval();
    return lower_ + share_.cwiseProduct(upper_ - lower_);
  }

 private:
  JointVector lower_, upper_, step_;
  JointVector share_;  // in [0, 1)
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
  constexpr int kPostures = 1024;
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
