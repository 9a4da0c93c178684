#include <dashpot/controller/vibration/jacobian_change.hpp>
#include <dashpot/controller/vibration/null_space_change.hpp>

#include <Eigen/Geometry>

namespace dashpot::controller {

using Eigen::Index;
using Eigen::Vector3d;

NullSpaceChange::NullSpaceChange(const DynamicsKernel& kernel, const JointVector& q,
                                 const DynamicsResult& robot, const NullSpace& null_space,
                                 bool in_tool_axes, bool dynamic) noexcept
    : tool_(in_tool_axes), dynamic_(dynamic), J_(robot.J), mass_(kernel, q, robot.J) {
  const Index n = J_.cols();
  share_.resize(n, 6);
  const TaskInertia& inertia = dynamic_ ? null_space.inertia() : null_space.of_projector();
  for (Index i = 0; i < 6; ++i) {
    const Vector6 unit = Vector6::Unit(i);
    inertia_.col(i) = inertia.wrench(unit);
    share_.col(i) = dynamic_ ? null_space.joint_velocity(unit) : null_space.explained(unit);
  }
  tip_torque_ = J_.transpose().lazyProduct(inertia_);
  mobility_.resize(n, n);
  for (Index i = 0; i < n; ++i) {
    const JointVector unit = JointVector::Unit(n, i);
    mobility_.col(i) = dynamic_ ? null_space.projected_acceleration(unit)
                                : null_space.projected_velocity(null_space.per_weight()[i] * unit);
  }
  torque_projector_ = JointMatrix::Identity(n, n);
  torque_projector_ -= J_.transpose().lazyProduct(share_.transpose());
  spreads_ = inertia.nearly_singular();
  if (spreads_) set_spread(null_space);
}

void NullSpaceChange::set_spread(const NullSpace& null_space) noexcept {
  const Index n = J_.cols();
  const TaskInertia& inertia = dynamic_ ? null_space.inertia() : null_space.of_projector();
  moved_ = J_.transpose();
  if (!dynamic_) moved_ = null_space.per_weight().asDiagonal() * moved_;
  for (Index i = 0; i < 6 && dynamic_; ++i) {
    null_space.mass().solve_L(&moved_(0, i));
    null_space.mass().solve_LT(&moved_(0, i));
  }
  std::array<Matrix6, kMaxJoints> change;  // of J M^-1 J' by each joint, column by column
  for (Index i = 0; i < 6; ++i) {
    const JointVector x = moved_.col(i);
    const Jacobian turned = twists(x);
    const Jacobian heavier = moved_.transpose().lazyProduct(inert(x));
    for (Index k = 0; k < n; ++k) {
      // The inertia's part is symmetric, so that half of it can be mirrored.
      change[static_cast<std::size_t>(k)].col(i) = turned.col(k) - 0.5 * heavier.col(k);
    }
  }
  for (Index k = 0; k < n; ++k) {
    const Matrix6& half = change[static_cast<std::size_t>(k)];
    spread_[static_cast<std::size_t>(k)] = inertia.spread(half + half.transpose());
  }
}

JointMatrix NullSpaceChange::inert(const JointVector& x) const noexcept {
  return dynamic_ ? mass_.times(x) : JointMatrix::Zero(x.size(), x.size());
}

Vector6 NullSpaceChange::turning(const Vector6& V, Index k) const noexcept {
  Vector6 change = Vector6::Zero();
  if (!tool_) return change;
  const Vector3d w = J_.col(k).tail<3>();
  change << w.cross(V.head<3>()), w.cross(V.tail<3>());
  return change;
}

Jacobian NullSpaceChange::twists(const JointVector& x) const noexcept {
  Jacobian change = twist_change(J_, x);
  if (!tool_) return change;
  const Vector6 V = twist(J_, x);
  for (Index k = 0; k < change.cols(); ++k) change.col(k) -= turning(V, k);
  return change;
}

JointMatrix NullSpaceChange::torques(const Vector6& F) const noexcept {
  JointMatrix change = geometric_stiffness(J_, F);
  if (!tool_) return change;
  for (Index k = 0; k < change.cols(); ++k) {
    const Vector6 turned = turning(F, k);
    for (Index j = 0; j < change.rows(); ++j) change(j, k) += J_.col(j).dot(turned);
  }
  return change;
}

JointMatrix NullSpaceChange::of_joint_velocity(const Vector6& V) const noexcept {
  const JointVector x = share_ * V;
  const JointMatrix moved = torques(inertia_ * V) - inert(x);
  JointMatrix change = mobility_.lazyProduct(moved);
  change -= share_.lazyProduct(twists(x));
  for (Index k = 0; spreads_ && k < change.cols(); ++k) {
    change.col(k) -= moved_ * (spread_[static_cast<std::size_t>(k)] * V);
  }
  return change;
}

JointMatrix NullSpaceChange::of_torque(const JointVector& t) const noexcept {
  JointVector z = JointVector::Zero(t.size());
  add_product(mobility_, t, z);
  const Vector6 h = share_.transpose() * t;
  JointMatrix change = inert(z);
  const JointMatrix projected = torques(h) + change;
  change -= torque_projector_.lazyProduct(projected);
  change -= tip_torque_.lazyProduct(twists(z));
  const Vector6 a = spreads_ ? Vector6(moved_.transpose() * t) : Vector6(Vector6::Zero());
  for (Index k = 0; spreads_ && k < change.cols(); ++k) {
    change.col(k) += J_.transpose() * (spread_[static_cast<std::size_t>(k)] * a);
  }
  return change;
}

}  // namespace dashpot::controller
