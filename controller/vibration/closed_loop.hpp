#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Returns Jdot (6 x n) at joint velocity qd: with j and k counted from the base, v and w the
/// linear and angular rows of J,
///     dJ_j/dq_k = (w_k x v_j, w_k x w_j) for k <= j,  (w_j x v_k, 0) for k > j.
Jacobian jacobian_rate(const Jacobian& J, const JointVector& qd) noexcept;

/// Returns K_G = [(dJ/dq_1)' f ... (dJ/dq_n)' f], n x n, for the wrench f in B's axes.
JointMatrix geometric_stiffness(const Jacobian& J, const Vector6& f) noexcept;

/// Sets P to N, which projects joint velocities on the null space.
void null_projector(const NullSpace& null_space, JointMatrix& P) noexcept;

/// K += P' diag(k) P
void add_projected(const JointMatrix& P, const JointVector& k, JointMatrix& K) noexcept;

/// Sets `system` to the robot with the springs and dampers of an impedance, M q'' + C q' + K q = f,
/// linearised where the springs are at rest (e = 0, q = q_d, q = q_0) and N stands still:
///     K = K_q + J' K_C J + N' K_0 N  [+ J' C_C Jdot]  [+ K_G(external wrench)]
///     C = C_q + J' C_C J + N' C_0 N + viscous friction of the joints.
/// TaskTerms says which terms in brackets are included. If none is, K is symmetric and has its
/// factor W. The feed-forward does not appear, because it depends on the set-point, not on the
/// state, except for Coriolis and gravity, which cancel the robot's Coriolis and gravity torques.
void closed_loop(const DynamicsResult& robot, const JointVector& qd, const Impedance& impedance,
                 const NullSpace& null_space, const JointVector& viscous_friction,
                 const TaskTerms& terms, const Vector6& external_wrench,
                 analysis::System<kMaxJoints>& system) noexcept;

}  // namespace dashpot::controller
