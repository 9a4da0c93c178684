#include <dashpot/controller/vibration/jacobian_change.hpp>
#include <dashpot/controller/vibration/null_space_change.hpp>

#include <Eigen/Geometry>

namespace dashpot::controller {

using Eigen::Index;
using Eigen::Vector3d;

NullSpaceChange::NullSpaceChange(const DynamicsKernel& kernel, const JointVector& q,
                                 const DynamicsResult& robot, const NullSpace& null_space,
                                 bool in_tool_axes) noexcept
    : tool_(in_tool_axes), J_(robot.J), mass_(kernel, q, robot.J) {
  const Index n = J_.cols();
  share_.resize(n, 6);
  for (Index i = 0; i < 6; ++i) {
    const Vector6 unit = Vector6::Unit(i);
    inertia_.col(i) = null_space.inertia().wrench(unit);
    share_.col(i) = null_space.joint_velocity(unit);
  }
  tip_torque_ = J_.transpose().lazyProduct(inertia_);
  mobility_.resize(n, n);
  for (Index i = 0; i < n; ++i) {
    mobility_.col(i) = null_space.projected_acceleration(JointVector::Unit(n, i));
  }
  torque_projector_ = JointMatrix::Identity(n, n);
  torque_projector_ -= J_.transpose().lazyProduct(share_.transpose());
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
  const JointMatrix inert = torques(inertia_ * V) - mass_.times(x);
  JointMatrix change = mobility_.lazyProduct(inert);
  change -= share_.lazyProduct(twists(x));
  return change;
}

JointMatrix NullSpaceChange::of_torque(const JointVector& t) const noexcept {
  JointVector z = JointVector::Zero(t.size());
  add_product(mobility_, t, z);
  const Vector6 h = share_.transpose() * t;
  JointMatrix change = mass_.times(z);
  const JointMatrix projected = torques(h) + change;
  change -= torque_projector_.lazyProduct(projected);
  change -= tip_torque_.lazyProduct(twists(z));
  return change;
}

}  // namespace dashpot::controller
