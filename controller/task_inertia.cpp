#include <dashpot/controller/task_inertia.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

using Eigen::Matrix3d;

/// diag(base) + R diag(tool) R'
Matrix3d held(const Eigen::Vector3d& base, const Eigen::Vector3d& tool, const Matrix3d& R) {
  Matrix3d H = base.asDiagonal();
  if (!tool.isZero(0)) H += R * tool.asDiagonal() * R.transpose();
  return H;
}

/// Mean of the diagonal; 1 if it is zero.
double mean(double trace) {
  return trace > 0 ? trace / 3 : 1.0;
}

}  // namespace

void TaskInertia::compute(const Matrix6& A, const TipImpedance& base, const TipImpedance& tool,
                          const Matrix3d& R_BT) noexcept {
  H_linear_ = held(base.held.head<3>(), tool.held.head<3>(), R_BT);
  H_angular_ = held(base.held.tail<3>(), tool.held.tail<3>(), R_BT);

  const Matrix3d A_linear = A.topLeftCorner<3, 3>(), A_angular = A.bottomRightCorner<3, 3>();
  const double D_linear = mean(A_linear.trace()), D_angular = mean(A_angular.trace());
  const Matrix3d I = Matrix3d::Identity();
  Matrix6 G = Matrix6::Zero();
  G.topLeftCorner<3, 3>() =
      H_linear_ * A_linear * H_linear_ + D_linear * (I - H_linear_ * H_linear_);
  G.bottomLeftCorner<3, 3>() = H_angular_ * A.bottomLeftCorner<3, 3>() * H_linear_;
  G.bottomRightCorner<3, 3>() =
      H_angular_ * A_angular * H_angular_ + D_angular * (I - H_angular_ * H_angular_);

  Vector6 D;
  D << D_linear, D_linear, D_linear, D_angular, D_angular, D_angular;
  const double least_pivot = 1e-14 * std::min(D_linear, D_angular);
  factor_.compute(G, least_pivot);
  regularity_ = 1 / factor_.trace_of_inverse(D);
  if (regularity_ >= kNearlySingular) return;
  const double deficit = 1 - regularity_ / kNearlySingular;
  G.diagonal() += kNearlySingular * deficit * deficit * D;
  factor_.compute(G, least_pivot);
}

}  // namespace dashpot::controller
