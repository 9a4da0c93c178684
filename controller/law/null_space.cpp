#include <dashpot/controller/law/null_space.hpp>

namespace dashpot::controller {

void NullSpace::compute(const JointMatrix& M, const Jacobian& J, const TipImpedance& base,
                        const TipImpedance& tool, const Eigen::Matrix3d& R_BT) noexcept {
  const auto n = static_cast<int>(M.rows());
  mass_.compute(M, 1e-14 * M.trace());
  Jh_.resize(6, n);
  Matrix6 A = Matrix6::Zero();  // Jh Jh'
  for (int i = 0; i < n; ++i) {
    Vector6 y = J.col(i);
    for (int k = 0; k < i; ++k) y -= mass_.L(i, k) * Jh_.col(k);
    y *= mass_.per_diagonal(i);
    Jh_.col(i) = y;
    A.noalias() += y * y.transpose();
  }
  inertia_.compute(A, base, tool, R_BT);
}

JointVector NullSpace::spring(const JointVector& k, const JointVector& dq) const noexcept {
  JointVector y(dq.size());
  for (Eigen::Index i = 0; i < dq.size(); ++i) y[i] = k[i] * dq[i];
  mass_.solve_L(y.data());
  project(y);
  mass_.multiply_L(y.data());
  return y;
}

JointVector NullSpace::projected_velocity(const JointVector& dq) const noexcept {
  JointVector y = dq;
  mass_.multiply_LT(y.data());
  project(y);
  mass_.solve_LT(y.data());
  return y;
}

JointVector NullSpace::joint_velocity(const Vector6& twist) const noexcept {
  JointVector y = JointVector::Zero(Jh_.cols());
  add_torque(Jh_, inertia_.wrench(twist), y);
  mass_.solve_LT(y.data());
  return y;
}

}  // namespace dashpot::controller
