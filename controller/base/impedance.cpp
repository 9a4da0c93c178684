#include <dashpot/controller/base/impedance.hpp>

#include <utility>

namespace dashpot::controller {
namespace {

/// The dampers C in the directions in which the stiffness K has no springs.
template <class Matrix>
Matrix beside_springs(const Matrix& K, const Matrix& C) noexcept {
  Matrix result = C;
  for (Eigen::Index i = 0; i < K.rows(); ++i) {
    if (!(K.row(i).array() != 0).any()) continue;
    result.row(i).setZero();
    result.col(i).setZero();
  }
  return result;
}

}  // namespace

Impedance::Impedance(int n)
    : null_stiffness(JointVector::Zero(n)),
      null_damping(JointVector::Zero(n)),
      joint_stiffness(JointMatrix::Zero(n, n)),
      joint_damping(JointMatrix::Zero(n, n)) {}

Impedance::Impedance(const Setpoint& setpoint, int n) noexcept : Impedance(n) {
  const Gains& gains = setpoint.gains;
  projectors = {};
  projectors[static_cast<std::size_t>(gains.null_projector)] = 1;
  if (setpoint.mode == Mode::kJoint) {
    joint_weight = 1;
    joint_damping_ratio = gains.joint_damping_ratio;
    const JointMatrix &K = gains.joint_stiffness, &C = gains.joint_damping;
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        joint_stiffness(i, j) = 0.5 * (K(i, j) + K(j, i));
        joint_damping(i, j) = 0.5 * (C(i, j) + C(j, i));
      }
    }
    if (joint_damping_ratio > 0) joint_damping = beside_springs(joint_stiffness, joint_damping);
    return;
  }
  task_weight = 1;
  damping_ratio = gains.task_damping_ratio;
  TipImpedance& tip = gains.frame == Frame::kBase ? base : tool;
  for (int i = 0; i < 6; ++i) {
    tip.selected[i] = gains.directions[static_cast<std::size_t>(i)] ? 1 : 0;
  }
  const auto in_selected_directions = [&](const Matrix6& A) -> Matrix6 {
    return tip.selected.asDiagonal() * (0.5 * (A + A.transpose())) * tip.selected.asDiagonal();
  };
  tip.stiffness = in_selected_directions(gains.task_stiffness);
  tip.damping = in_selected_directions(gains.task_damping);
  if (damping_ratio > 0) tip.damping = beside_springs(tip.stiffness, tip.damping);
  const bool unprojected = gains.null_projector == NullProjector::kNone;
  if (unprojected || n > tip.selected.sum()) {
    if (gains.null_stiffness.size() == n) null_stiffness = gains.null_stiffness;
    null_damping_ratio = gains.null_damping_ratio;
    const bool springs = (null_stiffness.array() != 0).any();
    if (gains.null_damping.size() == n && !(springs && null_damping_ratio > 0)) {
      null_damping = gains.null_damping;
    }
    if (unprojected && springs && null_damping_ratio > 0 && damping_ratio > 0) {
      null_damping_ratio = std::exchange(damping_ratio, 0);
      common_ratio = 1;
    }
  }
}

bool Impedance::null_space() const noexcept {
  bool any = false;
  for (Eigen::Index i = 0; i < null_stiffness.size(); ++i) {
    any |= null_stiffness[i] != 0 || null_damping[i] != 0;
  }
  return any;
}

Matrix6 turned(const Matrix6& K, const Eigen::Matrix3d& R) noexcept {
  Matrix6 result;
  for (int i = 0; i < 6; i += 3) {
    for (int j = 0; j < 6; j += 3) {
      result.block<3, 3>(i, j) = R * K.block<3, 3>(i, j) * R.transpose();
    }
  }
  return result;
}

Vector6 blend(const Vector6& a, const Vector6& b, double s) noexcept {
  return (1 - s) * a + s * b;
}

Impedance blend(const Impedance& a, const Impedance& b, double s) noexcept {
  const double r = 1 - s;
  Impedance c(static_cast<int>(a.null_stiffness.size()));
  const auto mix = [r, s](const auto& x, const auto& y, auto& z) {
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      z.data()[i] = r * x.data()[i] + s * y.data()[i];
    }
  };
  for (const auto number : {&Impedance::joint_weight, &Impedance::task_weight,
                            &Impedance::damping_ratio, &Impedance::joint_damping_ratio,
                            &Impedance::null_damping_ratio, &Impedance::common_ratio}) {
    c.*number = r * a.*number + s * b.*number;
  }
  for (std::size_t i = 0; i < c.projectors.size(); ++i) {
    c.projectors[i] = r * a.projectors[i] + s * b.projectors[i];
  }
  for (const auto tip : {&Impedance::base, &Impedance::tool}) {
    mix((a.*tip).stiffness, (b.*tip).stiffness, (c.*tip).stiffness);
    mix((a.*tip).damping, (b.*tip).damping, (c.*tip).damping);
    mix((a.*tip).selected, (b.*tip).selected, (c.*tip).selected);
  }
  mix(a.null_stiffness, b.null_stiffness, c.null_stiffness);
  mix(a.null_damping, b.null_damping, c.null_damping);
  mix(a.joint_stiffness, b.joint_stiffness, c.joint_stiffness);
  mix(a.joint_damping, b.joint_damping, c.joint_damping);
  return c;
}

}  // namespace dashpot::controller
