#include <dashpot/controller/law/task_inertia.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

using Eigen::Matrix3d;

/// diag(base) + R diag(tool) R'
Matrix3d selected(const Eigen::Vector3d& base, const Eigen::Vector3d& tool, const Matrix3d& R) {
  Matrix3d H = base.asDiagonal();
  if (!tool.isZero(0)) H += R * tool.asDiagonal() * R.transpose();
  return H;
}

/// Returns L^-T, column by column: L_ii x_i = e_i - sum of L_ij x_j, j < i.
Matrix6 inverse_transpose(const SmallCholesky& factor) {
  Matrix6 X = Matrix6::Identity();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) X.col(i) -= factor.L(i, j) * X.col(j);
    X.col(i) *= factor.per_diagonal(i);
  }
  return X;
}

/// Mean of the diagonal; 1 if it is zero.
double mean(double trace) {
  return trace > 0 ? trace / 3 : 1.0;
}

}  // namespace

void TaskInertia::compute(const Matrix6& A, const TipImpedance& base, const TipImpedance& tool,
                          const Matrix3d& R_BT) noexcept {
  const bool all_selected = base.selected.isOnes(0) && tool.none();  // H = I, as almost always
  const Matrix3d A_linear = A.topLeftCorner<3, 3>(), A_angular = A.bottomRightCorner<3, 3>();
  const double D_linear = mean(A_linear.trace()), D_angular = mean(A_angular.trace());
  Matrix3d H_linear, H_angular;  // the blocks of H; it has no others
  Matrix6 G;
  if (all_selected) {
    G = A;
  } else {
    H_linear = selected(base.selected.head<3>(), tool.selected.head<3>(), R_BT);
    H_angular = selected(base.selected.tail<3>(), tool.selected.tail<3>(), R_BT);
    const Matrix3d I = Matrix3d::Identity();
    G.setZero();
    G.topLeftCorner<3, 3>() = H_linear * A_linear * H_linear + D_linear * (I - H_linear * H_linear);
    G.bottomLeftCorner<3, 3>() = H_angular * A.bottomLeftCorner<3, 3>() * H_linear;
    G.bottomRightCorner<3, 3>() =
        H_angular * A_angular * H_angular + D_angular * (I - H_angular * H_angular);
  }

  Vector6 D;
  D << D_linear, D_linear, D_linear, D_angular, D_angular, D_angular;
  const double least_pivot = 1e-14 * std::min(D_linear, D_angular);
  factor_.compute(G, least_pivot);
  Matrix6 X = inverse_transpose(factor_);
  double trace = 0;  // of D G^-1
  for (int k = 0; k < 6; ++k) trace += D[k] * X.row(k).squaredNorm();
  regularity_ = 1 / trace;
  if (nearly_singular()) {
    const double deficit = 1 - regularity_ / kNearlySingular;
    regular_.noalias() = X * X.transpose();
    D_ = D;
    H_.setIdentity();
    if (!all_selected) {
      H_.topLeftCorner<3, 3>() = H_linear;
      H_.bottomRightCorner<3, 3>() = H_angular;
    }
    G.diagonal() += kNearlySingular * deficit * deficit * D;
    factor_.compute(G, least_pivot);
    X = inverse_transpose(factor_);
    selected_.noalias() = X * (X.transpose() * H_);
  }
  if (all_selected) {
    inertia_.noalias() = X * X.transpose();
    return;
  }
  Matrix6 LH;  // L^-1 H
  LH.leftCols<3>().noalias() = X.topRows<3>().transpose() * H_linear;
  LH.rightCols<3>().noalias() = X.bottomRows<3>().transpose() * H_angular;
  inertia_.noalias() = LH.transpose() * LH;
}

Matrix6 TaskInertia::spread(const Matrix6& dA) const noexcept {
  const double linear = dA.diagonal().head<3>().mean(), angular = dA.diagonal().tail<3>().mean();
  Vector6 dD;
  dD << linear, linear, linear, angular, angular, angular;
  Matrix6 dE = dD.asDiagonal() * (Matrix6::Identity() - H_ * H_);
  const Matrix6 dG = H_ * dA * H_ + dE;
  const Matrix6 of_regular = regular_ * dG * regular_;
  const double dw =
      regularity_ * regularity_ * (D_.dot(of_regular.diagonal()) - dD.dot(regular_.diagonal()));
  const double deficit = 1 - regularity_ / kNearlySingular;
  dE.diagonal() += kNearlySingular * deficit * deficit * dD - 2 * deficit * dw * D_;
  return selected_.transpose() * dE * selected_;
}

}  // namespace dashpot::controller
