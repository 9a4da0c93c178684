#pragma once
#include <dashpot/controller/base/joint_algebra.hpp>

namespace dashpot::controller {

/// Springs and dampers at the tip, and how much of each direction is selected (0 to 1), in the axes
/// of one frame.
struct TipImpedance {
  Matrix6 stiffness = Matrix6::Zero();
  Matrix6 damping = Matrix6::Zero();
  Vector6 selected = Vector6::Zero();

  bool none() const noexcept { return (selected.array() == 0).all(); }
};

/// Springs and dampers of every mode and frame at once; springs and dampers not in force are zero.
/// Weighted means of two impedances are impedances, and their matrices stay positive semidefinite.
template <int N>
struct Impedance {
  JointSquare<N> joint_stiffness = JointSquare<N>::Zero();
  JointSquare<N> joint_damping = JointSquare<N>::Zero();
  TipImpedance base;  ///< in B's axes
  TipImpedance tool;  ///< in T's axes
  Joints<N> null_stiffness = Joints<N>::Zero();
  Joints<N> null_damping = Joints<N>::Zero();
  double damping_ratio = 0;  ///< ratio that is designed for the tip's springs, beside `damping`
  double joint_damping_ratio = 0;  ///< for the joints' springs, beside `joint_damping`
  double joint_weight = 0;         ///< share of the joint springs
  double task_weight = 0;          ///< share of the Cartesian springs

  /// Returns the impedance that a valid set-point asks for. Directions that are not selected have
  /// no springs and dampers. There are no null-space springs and dampers unless there are more
  /// joints than selected directions.
  static Impedance of(const Setpoint& setpoint) noexcept;

  /// Returns true if there are springs or dampers in the null space.
  bool null_space() const noexcept {
    bool any = false;
    for (int i = 0; i < N; ++i) any |= null_stiffness[i] != 0 || null_damping[i] != 0;
    return any;
  }
};

template <int N>
Impedance<N> Impedance<N>::of(const Setpoint& setpoint) noexcept {
  Impedance result;
  const Gains& gains = setpoint.gains;
  if (setpoint.mode == Mode::kJoint) {
    result.joint_weight = 1;
    const bool designed = gains.joint_damping_ratio > 0;
    const JointMatrix &K = gains.joint_stiffness, &C = gains.joint_damping;
    for (int j = 0; j < N; ++j) {
      for (int i = 0; i < N; ++i) {
        result.joint_stiffness(i, j) = 0.5 * (K(i, j) + K(j, i));
        if (!designed) result.joint_damping(i, j) = 0.5 * (C(i, j) + C(j, i));
      }
    }
    if (designed) result.joint_damping_ratio = gains.joint_damping_ratio;
    return result;
  }
  result.task_weight = 1;
  TipImpedance& tip = gains.frame == Frame::kBase ? result.base : result.tool;
  int selected = 0;
  for (int i = 0; i < 6; ++i) {
    const bool hold = gains.directions[static_cast<std::size_t>(i)];
    tip.selected[i] = hold ? 1 : 0;
    selected += hold ? 1 : 0;
  }
  const auto in_selected_directions = [&](const Matrix6& A) -> Matrix6 {
    return tip.selected.asDiagonal() * (0.5 * (A + A.transpose())) * tip.selected.asDiagonal();
  };
  tip.stiffness = in_selected_directions(gains.task_stiffness);
  if (gains.task_damping_ratio > 0) {
    result.damping_ratio = gains.task_damping_ratio;
  } else {
    tip.damping = in_selected_directions(gains.task_damping);
  }
  if (N > selected) {
    if (gains.null_stiffness.size() == N) result.null_stiffness = fixed<N>(gains.null_stiffness);
    if (gains.null_damping.size() == N) result.null_damping = fixed<N>(gains.null_damping);
  }
  return result;
}

/// Returns diag(R, R) K diag(R, R)': K in the tool's axes, turned into B's axes.
inline Matrix6 turned(const Matrix6& K, const Eigen::Matrix3d& R) noexcept {
  Matrix6 result;
  for (int i = 0; i < 6; i += 3) {
    for (int j = 0; j < 6; j += 3) {
      result.block<3, 3>(i, j) = R * K.block<3, 3>(i, j) * R.transpose();
    }
  }
  return result;
}

/// Returns a + s (b - a) for 0 <= s <= 1, exactly b for s = 1.
inline Vector6 blend(const Vector6& a, const Vector6& b, double s) noexcept {
  return (1 - s) * a + s * b;
}

template <int N>
Impedance<N> blend(const Impedance<N>& a, const Impedance<N>& b, double s) noexcept {
  const double r = 1 - s;
  Impedance<N> c;
  const auto mix = [r, s](const auto& x, const auto& y, auto& z) {
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      z.data()[i] = r * x.data()[i] + s * y.data()[i];
    }
  };
  mix(a.joint_stiffness, b.joint_stiffness, c.joint_stiffness);
  mix(a.joint_damping, b.joint_damping, c.joint_damping);
  for (const auto tip : {&Impedance<N>::base, &Impedance<N>::tool}) {
    mix((a.*tip).stiffness, (b.*tip).stiffness, (c.*tip).stiffness);
    mix((a.*tip).damping, (b.*tip).damping, (c.*tip).damping);
    mix((a.*tip).selected, (b.*tip).selected, (c.*tip).selected);
  }
  mix(a.null_stiffness, b.null_stiffness, c.null_stiffness);
  mix(a.null_damping, b.null_damping, c.null_damping);
  c.damping_ratio = r * a.damping_ratio + s * b.damping_ratio;
  c.joint_damping_ratio = r * a.joint_damping_ratio + s * b.joint_damping_ratio;
  c.joint_weight = r * a.joint_weight + s * b.joint_weight;
  c.task_weight = r * a.task_weight + s * b.task_weight;
  return c;
}

}  // namespace dashpot::controller
