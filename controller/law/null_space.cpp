#include <dashpot/controller/base/small_cholesky.hpp>
#include <dashpot/controller/law/null_space.hpp>

#include <array>
#include <cmath>

namespace dashpot::controller {

void NullSpace::compute(const DynamicsResult& robot, const Impedance& impedance,
                        const analysis::BorneDamping& borne) noexcept {
  const JointMatrix& M = robot.M;
  const auto n = static_cast<int>(M.rows());
  mass_.compute(M, 1e-14 * M.trace());
  Jh_.resize(6, n);
  Matrix6 A = Matrix6::Zero();  // Jh Jh'
  for (int i = 0; i < n; ++i) {
    Vector6 y = robot.J.col(i);
    for (int k = 0; k < i; ++k) y -= mass_.L(i, k) * Jh_.col(k);
    y *= mass_.per_diagonal(i);
    Jh_.col(i) = y;
    A.noalias() += y * y.transpose();
  }
  inertia_.compute(A, impedance.base, impedance.tool, robot.R_BT);
  dynamic_ = impedance.share(NullProjector::kDynamic);
  const double given = impedance.share(NullProjector::kWeighted);
  weighted_ = given + impedance.share(NullProjector::kKinematic);
  unprojected_ = impedance.share(NullProjector::kNone);
  if (weighted_ > 0) {
    J_ = robot.J;
    per_weight_.setOnes(n);
    if (per_given_.size() == n) add(per_given_ - per_weight_, per_weight_, given / weighted_);
    const Jacobian weighted = J_ * per_weight_.asDiagonal();
    of_weights_.compute(weighted * J_.transpose(), impedance.base, impedance.tool, robot.R_BT);
  }
  level_ = {};
  ratio_damping_.resize(0, 0);
  if (impedance.null_damping_ratio > 0 && impedance.null_space()) {
    damp(robot.R_BT, {impedance, borne, level_});
  }
}

JointVector NullSpace::spring(const JointVector& k, const JointVector& dq) const noexcept {
  JointVector y(dq.size());
  for (Eigen::Index i = 0; i < dq.size(); ++i) y[i] = k[i] * dq[i];
  JointVector taken;  // by the share of weights
  if (weighted_ > 0) taken = weighted_ * held(per_weight_.cwiseProduct(y));
  if (dynamic_ > 0) {
    mass_.solve_L(y.data());
    project(y, dynamic_);
    mass_.multiply_L(y.data());
  }
  if (weighted_ > 0) y -= taken;
  return y;
}

JointVector NullSpace::projected_velocity(const JointVector& dq) const noexcept {
  JointVector y = dq, taken;
  if (weighted_ > 0) taken = weighted_ * per_weight_.cwiseProduct(held(y));
  if (dynamic_ > 0) {
    mass_.multiply_LT(y.data());
    project(y, dynamic_);
    mass_.solve_LT(y.data());
  }
  if (weighted_ > 0) y -= taken;
  return y;
}

JointVector NullSpace::projected_acceleration(const JointVector& torque) const noexcept {
  JointVector y = torque;
  mass_.solve_L(y.data());
  project(y);
  mass_.solve_LT(y.data());
  return y;
}

void NullSpace::damp(const Eigen::Matrix3d& R_BT, const Damping& damping) noexcept {
  const Impedance& impedance = damping.impedance;
  const JointVector& k = impedance.null_stiffness;
  const Eigen::Index n = k.size();
  JointMatrix& D = ratio_damping_;
  D.resize(n, n);
  if (unprojected_ == 0 && damp_one_motion(k, damping)) return;
  Matrix6 K_C = Matrix6::Zero();
  if (impedance.common_ratio > 0) {
    K_C = impedance.base.stiffness + turned(impedance.tool.stiffness, R_BT);
    K_C *= impedance.common_ratio;
  }
  std::array<JointVector, kMaxJoints> velocity;  // columns of L^-T P
  for (Eigen::Index j = 0; j < n; ++j) {
    JointVector& y = velocity[static_cast<std::size_t>(j)];
    y.setZero(n);
    y[j] = 1;
    project(y, 1 - unprojected_);
    mass_.solve_LT(y.data());
    const Vector6 pull = K_C * Jh_.col(j);  // of a P = I
    for (Eigen::Index i = 0; i <= j; ++i) {
      const JointVector& x = velocity[static_cast<std::size_t>(i)];
      double sum = Jh_.col(i).dot(pull);
      for (Eigen::Index l = 0; l < n; ++l) sum += k[l] * x[l] * y[l];
      D(i, j) = D(j, i) = sum;
    }
  }
  const SymmetricRoot root = symmetric_root(D);
  D.setZero();
  for (Eigen::Index l = 0; l < n; ++l) {
    if (root.roots[l] == 0) continue;
    const JointVector& v = root.vectors[static_cast<std::size_t>(l)];
    const double rate = damping(root.roots[l]);
    for (Eigen::Index j = 0; j < n; ++j) {
      const double scaled = rate * v[j];
      for (Eigen::Index i = 0; i < n; ++i) D(i, j) += scaled * v[i];
    }
  }
}

bool NullSpace::damp_one_motion(const JointVector& k, const Damping& damping) noexcept {
  constexpr double kNullRounding = 1e-9;
  const Eigen::Index n = k.size();
  double trace = 0, most = 0;  // of P's diagonal
  Eigen::Index best = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    const Vector6 column = Jh_.col(j);
    const double entry = 1 - column.dot(inertia_.wrench(column));
    trace += entry;
    if (entry > most) most = entry, best = j;
  }
  if (!(std::abs(trace - 1) < kNullRounding)) return false;
  JointVector y = JointVector::Unit(n, best);
  project(y);
  if (!(std::abs(product(y, y) - most) < kNullRounding)) return false;  // P is not a projector
  JointVector velocity = y;
  mass_.solve_LT(velocity.data());
  double stiffness = 0;
  for (Eigen::Index i = 0; i < n; ++i) stiffness += k[i] * velocity[i] * velocity[i];
  const double rate = damping(std::sqrt(stiffness / most)) / most;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) ratio_damping_(i, j) = rate * y[i] * y[j];
  }
  return true;
}

JointVector NullSpace::ratio_damper(const JointVector& dqd) const noexcept {
  JointVector y = dqd, result = JointVector::Zero(dqd.size());
  mass_.multiply_LT(y.data());
  add_product(ratio_damping_, y, result);
  mass_.multiply_L(result.data());
  return result;
}

JointVector NullSpace::explained(const Vector6& e) const noexcept {
  if (dynamic()) return joint_velocity(e);
  JointVector dq = JointVector::Zero(Jh_.cols()), result = dq;
  if (dynamic_ > 0) add(joint_velocity(e), result, dynamic_);
  if (weighted_ == 0) return result;
  add_torque(J_, of_weights_.wrench(e), dq);
  add(per_weight_.cwiseProduct(dq), result, weighted_);
  return result;
}

JointVector NullSpace::joint_velocity(const Vector6& twist) const noexcept {
  JointVector y = JointVector::Zero(Jh_.cols());
  add_torque(Jh_, inertia_.wrench(twist), y);
  mass_.solve_LT(y.data());
  return y;
}

}  // namespace dashpot::controller
