#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/controller/vibration/loop_system.hpp>

#include <cmath>

namespace dashpot::controller {
namespace {

/// C += J' A J, the upper triangle.
void add_upper_congruence(const Jacobian& J, const Matrix6& A, JointMatrix& C) noexcept {
  for (Eigen::Index j = 0; j < J.cols(); ++j) {
    const Vector6 column_j = A * J.col(j);
    for (Eigen::Index i = 0; i <= j; ++i) C(i, j) += J.col(i).dot(column_j);
  }
}

bool any(const JointVector& stiffness) noexcept {
  bool found = false;
  for (const double k : stiffness) found |= k != 0;
  return found;
}

}  // namespace

int selected_directions(const TipImpedance& base, const TipImpedance& tool) noexcept {
  if (!base.none() && !tool.none()) return -1;
  int count = 0;
  for (const TipImpedance* tip : {&base, &tool}) {
    for (const double selected : tip->selected) {
      if (selected != 0 && selected != 1) return -1;
      count += selected == 1 ? 1 : 0;
    }
  }
  return count;
}

void LoopSystem::add_tip_springs(const Jacobian& J, const TipImpedance& tip,
                                 const Eigen::Matrix3d* R, SpringFactor& factor) noexcept {
  factor.update(tip.stiffness.data(), 6);
  if (factor.rows() == 0) return;
  Matrix6 F = Eigen::Map<const Matrix6>(factor.matrix().data());  // F' above
  if (R != nullptr) {
    const Matrix6 in_tool = F;
    F.leftCols<3>() = in_tool.leftCols<3>() * R->transpose();
    F.rightCols<3>() = in_tool.rightCols<3>() * R->transpose();
  }
  for (int j = 0; j < n_; ++j) {
    const Vector6 top = F * J.col(j);
    for (int i = 0; i < factor.rows(); ++i) rows_.at(i, j) = top[i];
  }
  rows_.grow(factor.rows());
}

bool LoopSystem::follow_free_motions(const NullSpace& null_space, int r) noexcept {
  if (dimension_ == r) {
    for (int k = 0; k < r; ++k) {
      JointVector& y = Q_[static_cast<std::size_t>(k)];
      null_space.project(y);
      if (!orthonormalize(Q_.data(), k, 0.5, y)) dimension_ = 0;
    }
    if (dimension_ == r) return true;
  }
  // Start again: choose the unit vectors with the largest remaining projections, one by one.
  dimension_ = 0;
  std::array<JointVector, kMaxJoints> candidates;
  const auto n = static_cast<std::size_t>(n_);
  for (std::size_t j = 0; j < n; ++j) {
    candidates[j] = JointVector::Unit(n_, static_cast<Eigen::Index>(j));
    null_space.project(candidates[j]);
  }
  for (int k = 0; k < r; ++k) {
    std::size_t best = 0;
    double most = -1;
    for (std::size_t j = 0; j < n; ++j) {
      JointVector& y = candidates[j];
      if (k > 0) {
        const JointVector& q = Q_[static_cast<std::size_t>(k - 1)];
        add(q, y, -product(q, y));
      }
      const double left = product(y, y);
      if (left > most) most = left, best = j;
    }
    Q_[static_cast<std::size_t>(k)] = candidates[best];
    if (!orthonormalize(Q_.data(), k, 1e-3, Q_[static_cast<std::size_t>(k)])) return false;
  }
  dimension_ = r;
  return true;
}

bool LoopSystem::add_free_motions(const Impedance& impedance, const NullSpace& null_space, int r,
                                  JointMatrix& C) noexcept {
  if (!follow_free_motions(null_space, r)) return false;
  JointMatrix velocity(n_, r);   // L^-T q, by columns
  JointMatrix momentum(n_, r);   // L q
  JointMatrix K(r, r), D(r, r);  // K becomes its Cholesky factor
  const bool springs = any(impedance.null_stiffness);
  for (int k = 0; k < r; ++k) {
    velocity.col(k) = momentum.col(k) = Q_[static_cast<std::size_t>(k)];
    null_space.mass().solve_LT(&velocity(0, k));
    null_space.mass().multiply_L(&momentum(0, k));
    for (int l = 0; l <= k; ++l) {
      K(k, l) = D(k, l) = 0;
      for (int i = 0; i < n_; ++i) {
        const double both = velocity(i, k) * velocity(i, l);
        K(k, l) += impedance.null_stiffness[i] * both;
        D(k, l) += impedance.null_damping[i] * both;
      }
    }
  }
  if (impedance.null_damping_ratio > 0) {
    const JointMatrix& designed = null_space.ratio_damping();
    for (int k = 0; k < r; ++k) {
      JointVector y = JointVector::Zero(n_);
      add_product(designed, Q_[static_cast<std::size_t>(k)], y);
      for (int l = 0; l <= k; ++l) D(k, l) += product(Q_[static_cast<std::size_t>(l)], y);
    }
  }
  if (springs && !lower_cholesky(K, r)) return false;
  for (int k = 0; k < r; ++k) {
    for (int j = 0; j < n_; ++j) {
      double row = 0, damped = 0;
      for (int l = 0; l < r; ++l) {
        damped += momentum(j, l) * (l <= k ? D(k, l) : D(l, k));
        if (l >= k && springs) row += momentum(j, l) * K(l, k);
      }
      rows_.at(k, j) = row;
      for (int i = 0; i <= j; ++i) C(i, j) += momentum(i, k) * damped;
    }
  }
  if (springs) rows_.grow(r);
  return true;
}

void LoopSystem::add_null_space(const Impedance& impedance, const NullSpace& null_space,
                                JointMatrix& C) noexcept {
  const int selected = selected_directions(impedance.base, impedance.tool);
  if (null_space.dynamic() && selected >= 0 && selected < n_ &&
      !null_space.inertia().nearly_singular() &&
      add_free_motions(impedance, null_space, n_ - selected, C)) {
    return;
  }
  dimension_ = 0;
  JointMatrix projector(n_, n_);
  null_projector(null_space, projector);
  for (int j = 0; j < n_; ++j) {
    for (int i = 0; i < n_; ++i) {
      rows_.at(i, j) = std::sqrt(impedance.null_stiffness[i]) * projector(i, j);
    }
  }
  add_projected(projector, impedance.null_damping, C);
  if (impedance.null_damping_ratio > 0) add_null_damping(null_space, C);
  if (any(impedance.null_stiffness)) rows_.grow(n_);
}

void LoopSystem::form(const DynamicsResult& robot, const Impedance& impedance,
                      const NullSpace& null_space, const JointVector& viscous_friction,
                      analysis::System<kMaxJoints>& system) noexcept {
  n_ = static_cast<int>(robot.M.rows());
  rows_.clear();
  JointMatrix& C = system.damping;
  C = impedance.joint_damping;
  for (int i = 0; i < n_; ++i) C(i, i) += viscous_friction[i];
  bool whole = false;  // the rows are fit as they are
  if (impedance.task_weight > 0) {
    add_tip_springs(robot.J, impedance.base, nullptr, base_);
    add_tip_springs(robot.J, impedance.tool, &robot.R_BT, tool_);
    const Matrix6 C_C = impedance.tool.none()
                            ? impedance.base.damping
                            : impedance.base.damping + turned(impedance.tool.damping, robot.R_BT);
    add_upper_congruence(robot.J, C_C, C);
    if (impedance.null_space()) add_null_space(impedance, null_space, C);
  }
  if (impedance.joint_weight > 0) {
    joint_.update(impedance.joint_stiffness.data(), n_);
    whole = rows_.size() == 0;
    for (int j = 0; j < n_; ++j) {
      for (int i = 0; i < joint_.rows(); ++i) rows_.at(i, j) = joint_.matrix()(i, j);
    }
    rows_.grow(joint_.rows());
  }
  // The tip's rows alone move smoothly through singularities, where a triangle's may turn at once.
  whole |= rows_.size() == n_ && impedance.joint_weight == 0 && !impedance.null_space();
  if (rows_.size() >= n_ && !whole) rows_.triangularize(n_);

  system.has_low_words = false;
  system.mass = robot.M;
  system.stiffness_factor.resize(rows_.size(), n_);
  for (int j = 0; j < n_; ++j) {
    for (int i = 0; i < j; ++i) C(j, i) = C(i, j);
    for (int i = 0; i < rows_.size(); ++i) system.stiffness_factor(i, j) = rows_.at_row(i, j);
  }
}

}  // namespace dashpot::controller
