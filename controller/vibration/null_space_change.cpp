#include <dashpot/controller/vibration/jacobian_change.hpp>
#include <dashpot/controller/vibration/null_space_change.hpp>

#include <Eigen/Geometry>

namespace dashpot::controller {

using Eigen::Index;
using Eigen::Vector3d;

Vector6 NullSpaceChange::turning(const Vector6& V, Index k) const noexcept {
  Vector6 change = Vector6::Zero();
  if (!tool_) return change;
  const Vector3d w = robot_.J.col(k).tail<3>();
  change << w.cross(V.head<3>()), w.cross(V.tail<3>());
  return change;
}

Jacobian NullSpaceChange::twists(const JointVector& x) const noexcept {
  Jacobian change = twist_change(robot_.J, x);
  if (!tool_) return change;
  const Vector6 V = twist(robot_.J, x);
  for (Index k = 0; k < change.cols(); ++k) change.col(k) -= turning(V, k);
  return change;
}

JointMatrix NullSpaceChange::torques(const Vector6& F) const noexcept {
  JointMatrix change = geometric_stiffness(robot_.J, F);
  if (!tool_) return change;
  for (Index k = 0; k < change.cols(); ++k) {
    const Vector6 turned = turning(F, k);
    for (Index j = 0; j < change.rows(); ++j) change(j, k) += robot_.J.col(j).dot(turned);
  }
  return change;
}

JointMatrix NullSpaceChange::of_joint_velocity(const Vector6& V) const noexcept {
  const Index n = robot_.J.cols();
  const JointVector x = null_space_.joint_velocity(V);
  const Jacobian moved = twists(x);
  const JointMatrix mass = kernel_.mass_change(q_, robot_.J, x);
  JointMatrix change = torques(null_space_.inertia().wrench(V));
  for (Index k = 0; k < n; ++k) {
    JointVector y(n);
    for (Index i = 0; i < n; ++i) y[i] = change(i, k) - mass(i, k);
    y = null_space_.projected_acceleration(y);
    add(null_space_.joint_velocity(moved.col(k)), y, -1);
    for (Index i = 0; i < n; ++i) change(i, k) = y[i];
  }
  return change;
}

JointMatrix NullSpaceChange::of_torque(const JointVector& t) const noexcept {
  const Index n = robot_.J.cols();
  const JointVector ones = JointVector::Ones(n);
  JointVector u = t;
  null_space_.mass().solve_L(u.data());
  null_space_.mass().solve_LT(u.data());
  const JointVector z = null_space_.projected_acceleration(t);
  const Jacobian moved = twists(z);
  const JointMatrix mass = kernel_.mass_change(q_, robot_.J, z);
  JointMatrix change = torques(null_space_.inertia().wrench(twist(robot_.J, u)));
  for (Index k = 0; k < n; ++k) {
    JointVector y(n), inert(n);
    for (Index i = 0; i < n; ++i) {
      inert[i] = mass(i, k);
      y[i] = -change(i, k) - inert[i];
    }
    y = null_space_.spring(ones, y);
    add(inert, y);
    add_torque(robot_.J, -null_space_.inertia().wrench(moved.col(k)), y);
    for (Index i = 0; i < n; ++i) change(i, k) = y[i];
  }
  return change;
}

}  // namespace dashpot::controller
