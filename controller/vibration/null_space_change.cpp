#include <dashpot/controller/vibration/jacobian_change.hpp>
#include <dashpot/controller/vibration/null_space_change.hpp>

#include <Eigen/Geometry>

namespace dashpot::controller {

using Eigen::Index;
using Eigen::Vector3d;

NullSpaceChange::NullSpaceChange(const DynamicsKernel& kernel, const JointVector& q,
                                 const DynamicsResult& robot, const NullSpace& null_space,
                                 bool in_tool_axes, bool dynamic) noexcept
    : tool_(in_tool_axes), J_(robot.J), mass_(kernel, q, robot.J) {
  const Index n = J_.cols();
  parts_[0].dynamic = true;
  parts_[0].factor = dynamic ? 1 - null_space.unprojected_share() : null_space.dynamic_share();
  parts_[1].factor = dynamic ? 0 : null_space.weighted_share();
  share_.setZero(n, 6);
  for (Part& part : parts_) {
    if (part.factor == 0) continue;
    fill(null_space, part);
    share_ += part.factor * part.share;
  }
  torque_projector_ = JointMatrix::Identity(n, n);
  torque_projector_ -= J_.transpose().lazyProduct(share_.transpose());
}

void NullSpaceChange::fill(const NullSpace& null_space, Part& part) noexcept {
  const Index n = J_.cols();
  const TaskInertia& inertia = part.dynamic ? null_space.inertia() : null_space.of_projector();
  part.share.resize(n, 6);
  for (Index i = 0; i < 6; ++i) {
    const Vector6 unit = Vector6::Unit(i);
    part.inertia.col(i) = inertia.wrench(unit);
    if (part.dynamic) part.share.col(i) = null_space.joint_velocity(unit);
  }
  part.tip_torque = J_.transpose().lazyProduct(part.inertia);
  if (!part.dynamic) part.share = null_space.per_weight().asDiagonal() * part.tip_torque;
  part.projector = JointMatrix::Identity(n, n);
  part.projector -= J_.transpose().lazyProduct(part.share.transpose());
  part.mobility.resize(n, n);
  for (Index i = 0; i < n; ++i) {
    if (part.dynamic) {
      part.mobility.col(i) = null_space.projected_acceleration(JointVector::Unit(n, i));
    } else {
      part.mobility.col(i) = null_space.per_weight()[i] * part.projector.row(i).transpose();
    }
  }
  part.spreads = inertia.nearly_singular();
  if (part.spreads) set_spread(null_space, part);
}

void NullSpaceChange::set_spread(const NullSpace& null_space, Part& part) noexcept {
  const Index n = J_.cols();
  const TaskInertia& inertia = part.dynamic ? null_space.inertia() : null_space.of_projector();
  part.moved = J_.transpose();
  if (!part.dynamic) part.moved = null_space.per_weight().asDiagonal() * part.moved;
  for (Index i = 0; i < 6 && part.dynamic; ++i) {
    null_space.mass().solve_L(&part.moved(0, i));
    null_space.mass().solve_LT(&part.moved(0, i));
  }
  std::array<Matrix6, kMaxJoints> change;  // of J M^-1 J' by each joint, column by column
  for (Index i = 0; i < 6; ++i) {
    const JointVector x = part.moved.col(i);
    const Jacobian turned = twists(x);
    const Jacobian heavier = part.moved.transpose().lazyProduct(inert(part, x));
    for (Index k = 0; k < n; ++k) {
      // The inertia's part is symmetric, so that half of it can be mirrored.
      change[static_cast<std::size_t>(k)].col(i) = turned.col(k) - 0.5 * heavier.col(k);
    }
  }
  for (Index k = 0; k < n; ++k) {
    const Matrix6& half = change[static_cast<std::size_t>(k)];
    part.spread[static_cast<std::size_t>(k)] = inertia.spread(half + half.transpose());
  }
}

JointMatrix NullSpaceChange::inert(const Part& part, const JointVector& x) const noexcept {
  return part.dynamic ? mass_.times(x) : JointMatrix::Zero(x.size(), x.size());
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
  JointMatrix sum = JointMatrix::Zero(J_.cols(), J_.cols());
  for (const Part& part : parts_) {
    if (part.factor == 0) continue;
    const JointVector x = part.share * V;
    const JointMatrix moved = torques(part.inertia * V) - inert(part, x);
    JointMatrix change = part.mobility.lazyProduct(moved);
    change -= part.share.lazyProduct(twists(x));
    for (Index k = 0; part.spreads && k < change.cols(); ++k) {
      change.col(k) -= part.moved * (part.spread[static_cast<std::size_t>(k)] * V);
    }
    sum += part.factor * change;
  }
  return sum;
}

JointMatrix NullSpaceChange::of_torque(const JointVector& t) const noexcept {
  JointMatrix sum = JointMatrix::Zero(t.size(), t.size());
  for (const Part& part : parts_) {
    if (part.factor == 0) continue;
    JointVector z = JointVector::Zero(t.size());
    add_product(part.mobility, t, z);
    const Vector6 h = part.share.transpose() * t;
    JointMatrix change = inert(part, z);
    const JointMatrix projected = torques(h) + change;
    change -= part.projector.lazyProduct(projected);
    change -= part.tip_torque.lazyProduct(twists(z));
    const Vector6 a = part.spreads ? Vector6(part.moved.transpose() * t) : Vector6(Vector6::Zero());
    for (Index k = 0; part.spreads && k < change.cols(); ++k) {
      change.col(k) += J_.transpose() * (part.spread[static_cast<std::size_t>(k)] * a);
    }
    sum += part.factor * change;
  }
  return sum;
}

}  // namespace dashpot::controller
