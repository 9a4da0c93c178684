#pragma once
#include <dashpot/controller/robot_types.hpp>

namespace dashpot::controller {

/// Returns Jdot (6 x n) at joint velocity qd: with j and k counted from the base, v and w the
/// linear and angular rows of J,
///     dJ_j/dq_k = (w_k x v_j, w_k x w_j) for k <= j,  (w_j x v_k, 0) for k > j.
Jacobian jacobian_rate(const Jacobian& J, const JointVector& qd) noexcept;

/// Returns K_G(f) = [(dJ/dq_1)' f ... (dJ/dq_n)' f], n x n, for the wrench f in B's axes: how the
/// joint torques J' f change with q where f stays.
JointMatrix geometric_stiffness(const Jacobian& J, const Vector6& f) noexcept;

/// Returns d(J x)/dq (6 x n) for constant x: column k is (dJ/dq_k) x.
Jacobian twist_change(const Jacobian& J, const JointVector& x) noexcept;

}  // namespace dashpot::controller
