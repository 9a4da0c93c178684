#pragma once
#include <dashpot/controller/types.hpp>

namespace dashpot::controller {

/// Springs and dampers of every mode and frame at once: those not in force are zero. Weighted means
/// of two impedances are impedances, and their matrices stay positive semidefinite.
template <int N>
struct Impedance {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;

  /// Springs and dampers at the tip, and how much of each direction is held (0 to 1), in the axes
  /// of one frame.
  struct Tip {
    Matrix6 stiffness = Matrix6::Zero();
    Matrix6 damping = Matrix6::Zero();
    Vector6 held = Vector6::Zero();

    bool none() const noexcept { return (held.array() == 0).all(); }
  };

  Square joint_stiffness = Square::Zero();
  Square joint_damping = Square::Zero();
  Tip base;
  Tip tool;
  Vector null_stiffness = Vector::Zero();
  Vector null_damping = Vector::Zero();
  double joint_weight = 0;  ///< share of the joint springs
  double task_weight = 0;   ///< share of the Cartesian springs

  /// What a valid set-point asks for. Directions that are not held have no springs and dampers. The
  /// null space is empty unless there are more joints than directions held.
  static Impedance of(const Setpoint& setpoint) noexcept;

  /// Whether there is anything to do in the null space.
  bool null_space() const noexcept {
    return (null_stiffness.array() != 0).any() || (null_damping.array() != 0).any();
  }
};

template <int N>
Impedance<N> Impedance<N>::of(const Setpoint& setpoint) noexcept {
  Impedance result;
  const Gains& gains = setpoint.gains;
  if (setpoint.mode == Mode::kJoint) {
    result.joint_weight = 1;
    result.joint_stiffness = 0.5 * (gains.joint_stiffness + gains.joint_stiffness.transpose());
    result.joint_damping = 0.5 * (gains.joint_damping + gains.joint_damping.transpose());
    return result;
  }
  result.task_weight = 1;
  Tip& tip = gains.frame == Frame::kBase ? result.base : result.tool;
  int held = 0;
  for (int i = 0; i < 6; ++i) {
    const bool hold = gains.directions[static_cast<std::size_t>(i)];
    tip.held[i] = hold ? 1 : 0;
    held += hold ? 1 : 0;
  }
  const auto in_held_directions = [&](const Matrix6& A) -> Matrix6 {
    return tip.held.asDiagonal() * (0.5 * (A + A.transpose())) * tip.held.asDiagonal();
  };
  tip.stiffness = in_held_directions(gains.task_stiffness);
  tip.damping = in_held_directions(gains.task_damping);
  if (N > held) {
    if (gains.null_stiffness.size() == N) result.null_stiffness = gains.null_stiffness;
    if (gains.null_damping.size() == N) result.null_damping = gains.null_damping;
  }
  return result;
}

/// a + s (b - a) for 0 <= s <= 1, exactly b for s = 1.
inline Vector6 blend(const Vector6& a, const Vector6& b, double s) noexcept {
  return (1 - s) * a + s * b;
}

template <int N>
Impedance<N> blend(const Impedance<N>& a, const Impedance<N>& b, double s) noexcept {
  const double r = 1 - s;
  Impedance<N> c;
  c.joint_stiffness = r * a.joint_stiffness + s * b.joint_stiffness;
  c.joint_damping = r * a.joint_damping + s * b.joint_damping;
  for (const auto tip : {&Impedance<N>::base, &Impedance<N>::tool}) {
    (c.*tip).stiffness = r * (a.*tip).stiffness + s * (b.*tip).stiffness;
    (c.*tip).damping = r * (a.*tip).damping + s * (b.*tip).damping;
    (c.*tip).held = r * (a.*tip).held + s * (b.*tip).held;
  }
  c.null_stiffness = r * a.null_stiffness + s * b.null_stiffness;
  c.null_damping = r * a.null_damping + s * b.null_damping;
  c.joint_weight = r * a.joint_weight + s * b.joint_weight;
  c.task_weight = r * a.task_weight + s * b.task_weight;
  return c;
}

}  // namespace dashpot::controller
