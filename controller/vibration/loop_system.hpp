#pragma once
#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/controller/vibration/spring_factors.hpp>

namespace dashpot::controller {

/// The closed loop of closed_loop.hpp in the form in which modes are followed from tick to tick:
/// M, C and a factor W of K = W' W with at most n rows that moves as smoothly as the robot does. K
/// itself is not formed, and nothing is squared.
///
/// W stacks the rows of the springs that there are:
///     F' J              K_C = F F' in the axes in which it is given, J turned into them,
///     G' (L Q)'         the null space: with M = L L', Q (n x r) spans the free motions in energy
///                       coordinates, G G' = Q' L^-1 K_0 L^-T Q,
///     H'                K_q = H H'.
/// If there are as many rows as joints, or more, they are replaced by the upper triangle with
/// W' W = K; exactly n rows of the tip's springs alone are not. Q is computed by projecting the Q
/// of the last tick. Where the arm is nearly singular or gains change between two sets of selected
/// directions, N has no such Q, and sqrt(K_0) N takes the place of the null space's rows.
template <int N>
class LoopSystem {
 public:
  /// Forgets the last tick.
  void reset() noexcept { dimension_ = 0; }

  /// Fills mass, damping and stiffness_factor of `system`. The factor has as many rows as there are
  /// modes. `null_space` is the robot's null space; it is used only if the impedance has null-space
  /// springs or dampers.
  void form(const Dynamics<N>& robot, const Impedance<N>& impedance, const NullSpace<N>& null_space,
            const Joints<N>& viscous_friction, analysis::System<kMaxJoints>& system) noexcept;

 private:
  void add_tip_springs(const Jacobian<N>& J, const TipImpedance& tip, const Eigen::Matrix3d* R,
                       SpringFactor<6>& factor) noexcept;
  void add_null_space(const Impedance<N>& impedance, const NullSpace<N>& null_space,
                      JointSquare<N>& C) noexcept;
  bool add_free_motions(const Impedance<N>& impedance, const NullSpace<N>& null_space, int r,
                        JointSquare<N>& C) noexcept;
  bool follow_free_motions(const NullSpace<N>& null_space, int r) noexcept;

  FactorRows<N> rows_;
  SpringFactor<6> base_, tool_;
  SpringFactor<N> joint_;
  std::array<Joints<N>, N> Q_;
  int dimension_ = 0;  ///< r of Q; 0: there is no Q
};

/// Returns the number of selected directions, if each is selected wholly or not at all, and all in
/// one frame; otherwise -1.
inline int selected_directions(const TipImpedance& base, const TipImpedance& tool) noexcept {
  if (!base.none() && !tool.none()) return -1;
  int count = 0;
  for (const TipImpedance* tip : {&base, &tool}) {
    for (int i = 0; i < 6; ++i) {
      if (tip->selected[i] == 1)
        ++count;
      else if (tip->selected[i] != 0)
        return -1;
    }
  }
  return count;
}

/// C += J' A J, the upper triangle.
template <int N>
void add_upper_congruence(const Jacobian<N>& J, const Matrix6& A, JointSquare<N>& C) noexcept {
  for (int j = 0; j < N; ++j) {
    const Vector6 column_j = A * column<N>(J, j);
    for (int i = 0; i <= j; ++i) C(i, j) += column<N>(J, i).dot(column_j);
  }
}

template <int N>
void LoopSystem<N>::add_tip_springs(const Jacobian<N>& J, const TipImpedance& tip,
                                    const Eigen::Matrix3d* R, SpringFactor<6>& factor) noexcept {
  factor.update(tip.stiffness);
  if (factor.rows() == 0) return;
  Matrix6 F = factor.matrix();  // F' above
  if (R != nullptr) {
    const Matrix6 in_tool = F;
    F.template leftCols<3>() = in_tool.template leftCols<3>() * R->transpose();
    F.template rightCols<3>() = in_tool.template rightCols<3>() * R->transpose();
  }
  for (int j = 0; j < N; ++j) {
    const Vector6 top = F * column<N>(J, j);
    for (int i = 0; i < factor.rows(); ++i) rows_.at(i, j) = top[i];
  }
  rows_.grow(factor.rows());
}

template <int N>
bool LoopSystem<N>::follow_free_motions(const NullSpace<N>& null_space, int r) noexcept {
  if (dimension_ == r) {
    for (int k = 0; k < r; ++k) {
      Joints<N>& y = Q_[static_cast<std::size_t>(k)];
      null_space.project(y);
      if (!orthonormalize<N>(Q_.data(), k, 0.5, y)) dimension_ = 0;
    }
    if (dimension_ == r) return true;
  }
  // Start again: choose the unit vectors with the largest remaining projections, one by one.
  dimension_ = 0;
  std::array<Joints<N>, N> candidates;
  for (int j = 0; j < N; ++j) {
    Joints<N>& y = candidates[static_cast<std::size_t>(j)];
    for (int i = 0; i < N; ++i) y[i] = i == j ? 1 : 0;
    null_space.project(y);
  }
  for (int k = 0; k < r; ++k) {
    std::size_t best = 0;
    double most = -1;
    for (std::size_t j = 0; j < N; ++j) {
      Joints<N>& y = candidates[j];
      if (k > 0) remove_component<N>(Q_[static_cast<std::size_t>(k - 1)], y);
      const double left = product<N>(y, y);
      if (left > most) most = left, best = j;
    }
    Q_[static_cast<std::size_t>(k)] = candidates[best];
    if (!orthonormalize<N>(Q_.data(), k, 1e-3, Q_[static_cast<std::size_t>(k)])) return false;
  }
  dimension_ = r;
  return true;
}

template <int N>
bool LoopSystem<N>::add_free_motions(const Impedance<N>& impedance, const NullSpace<N>& null_space,
                                     int r, JointSquare<N>& C) noexcept {
  if (!follow_free_motions(null_space, r)) return false;
  std::array<Joints<N>, N> velocity;  // L^-T q
  std::array<Joints<N>, N> momentum;  // L q
  JointSquare<N> K, D;                // r x r of them; K becomes its Cholesky factor
  bool springs = false;
  for (int i = 0; i < N; ++i) springs |= impedance.null_stiffness[i] != 0;
  for (int k = 0; k < r; ++k) {
    const auto at = static_cast<std::size_t>(k);
    velocity[at] = momentum[at] = Q_[at];
    null_space.mass().solve_LT(velocity[at]);
    null_space.mass().multiply_L(momentum[at]);
    for (int l = 0; l <= k; ++l) {
      K(k, l) = D(k, l) = 0;
      for (int i = 0; i < N; ++i) {
        const double both = velocity[at][i] * velocity[static_cast<std::size_t>(l)][i];
        K(k, l) += impedance.null_stiffness[i] * both;
        D(k, l) += impedance.null_damping[i] * both;
      }
    }
  }
  if (springs && !lower_cholesky<N>(r, K)) return false;
  for (int k = 0; k < r; ++k) {
    Joints<N> damped = Joints<N>::Zero(), row = Joints<N>::Zero();
    for (int l = 0; l < r; ++l) {
      add<N>(momentum[static_cast<std::size_t>(l)], damped, l <= k ? D(k, l) : D(l, k));
      if (l >= k) add<N>(momentum[static_cast<std::size_t>(l)], row, springs ? K(l, k) : 0);
    }
    for (int j = 0; j < N; ++j) {
      rows_.at(k, j) = row[j];
      for (int i = 0; i <= j; ++i) C(i, j) += momentum[static_cast<std::size_t>(k)][i] * damped[j];
    }
  }
  if (springs) rows_.grow(r);
  return true;
}

template <int N>
void LoopSystem<N>::add_null_space(const Impedance<N>& impedance, const NullSpace<N>& null_space,
                                   JointSquare<N>& C) noexcept {
  const int selected = selected_directions(impedance.base, impedance.tool);
  if (selected >= 0 && selected < N && !null_space.inertia().nearly_singular() &&
      add_free_motions(impedance, null_space, N - selected, C)) {
    return;
  }
  dimension_ = 0;
  JointSquare<N> projector;
  for (int j = 0; j < N; ++j) {
    Joints<N> unit = Joints<N>::Zero();
    unit[j] = 1;
    unit = null_space.projected_velocity(unit);
    for (int i = 0; i < N; ++i) {
      projector(i, j) = unit[i];
      rows_.at(i, j) = std::sqrt(impedance.null_stiffness[i]) * unit[i];
    }
  }
  add_projected<N>(projector, impedance.null_damping, C);
  bool springs = false;
  for (int i = 0; i < N; ++i) springs |= impedance.null_stiffness[i] != 0;
  if (springs) rows_.grow(N);
}

template <int N>
void LoopSystem<N>::form(const Dynamics<N>& robot, const Impedance<N>& impedance,
                         const NullSpace<N>& null_space, const Joints<N>& viscous_friction,
                         analysis::System<kMaxJoints>& system) noexcept {
  rows_.clear();
  JointSquare<N> C = impedance.joint_damping;
  for (int i = 0; i < N; ++i) C(i, i) += viscous_friction[i];
  bool whole = false;  // the rows are fit as they are
  if (impedance.task_weight > 0) {
    add_tip_springs(robot.J, impedance.base, nullptr, base_);
    add_tip_springs(robot.J, impedance.tool, &robot.R_BT, tool_);
    const Matrix6 C_C = impedance.tool.none()
                            ? impedance.base.damping
                            : impedance.base.damping + turned(impedance.tool.damping, robot.R_BT);
    add_upper_congruence<N>(robot.J, C_C, C);
    if (impedance.null_space()) add_null_space(impedance, null_space, C);
  }
  if (impedance.joint_weight > 0) {
    joint_.update(impedance.joint_stiffness);
    whole = rows_.size() == 0;
    for (int i = 0; i < joint_.rows(); ++i) {
      for (int j = 0; j < N; ++j) rows_.at(i, j) = joint_.matrix()(i, j);
    }
    rows_.grow(joint_.rows());
  }
  // The tip's rows alone move smoothly through singularities, where a triangle's may turn at once.
  whole |= rows_.size() == N && impedance.joint_weight == 0 && !impedance.null_space();
  if (rows_.size() >= N && !whole) rows_.triangularize();

  system.has_low_words = false;
  system.mass.resize(N, N);
  system.damping.resize(N, N);
  system.stiffness_factor.resize(rows_.size(), N);
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < N; ++i) {
      system.mass(i, j) = robot.M(i, j);
      system.damping(i, j) = i <= j ? C(i, j) : C(j, i);
    }
    for (int i = 0; i < rows_.size(); ++i) system.stiffness_factor(i, j) = rows_.at_row(i, j);
  }
}

}  // namespace dashpot::controller
