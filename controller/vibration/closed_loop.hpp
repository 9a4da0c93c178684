#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/vibration/jacobian_change.hpp>
#include <dashpot/controller/vibration/null_space_change.hpp>

#include <optional>

namespace dashpot::controller {

/// The wrenches at the tip, in B's axes, that do not come from springs, N and N m.
struct TipWrenches {
  Vector6 world = Vector6::Zero();      ///< f, which the world exerts
  Vector6 commanded = Vector6::Zero();  ///< f_c, the feed-forward
  Vector6 posture = Vector6::Zero();    ///< f_p, of posture springs without projector
};

/// Returns the stiffness of the load itself, n x n: minus the change of its joint torques with q,
///     -K_G(f)                               base_wrench: f is constant in B's axes
///     -K_G(f) + J' ([f_l x]; [f_m x]) J_w   tool_wrench: f turns with the tip, J_w = rows 4-6 of J
///     0                                     joint_torques: J' f is constant.
JointMatrix stiffness_of_load(const Jacobian& J, Load load, const Vector6& f) noexcept;

/// The posture springs of an arm that holds a load.
struct LoadedPosture {
  const NullSpaceChange& change;
  const JointVector& error;  ///< p = q_0 - q - s J# e, n; see ImpedanceLaw
};

/// Returns what a load adds to the stiffness J' K_C J of springs at rest, n x n, where the springs
/// of `impedance` hold it: they carry F = -w_C (f + f_c) - f_p, without the directions in which
/// there is no spring, at the error e with K_C e = F, and
///     -d(J' (F + f_c) + load)/dq - J' K_C J = J' (S - K_C J) - K_G(F + f_c) + stiffness_of_load,
///     S = K_B (J_v; A J_w) + K_T (J_v; A J_w) + (([F_l x]; [F_m x]) - K_T ([e_l x]; [e_m x])) J_w.
/// K_B is given in B's axes, K_T in the tool's and turned into B's; F in the second line is the
/// wrench of K_T. A = I + [e_m x]/2 + (1/a^2 - (1 + cos a)/(2 a sin a)) [e_m x]^2, a = |e_m|, is
/// the derivative of the rotation vector. So a constant wrench of the world and the springs that
/// hold it cancel up to e, whereas constant joint torques leave +K_G(f), the term of the paper.
///
/// Springs of joints carry none of F, and K_C has to hold all of it, but posture springs without a
/// projector carry f_p = Lambda J M^-1 K_0 p of it as they pull just now. A deflection of more than
/// 2 rad counts as one of 2 rad.
///
/// The load also adds to the stiffness N' K_0 N of posture springs, as N' and J# e change with q,
///     -d(N' t)/dq + N' K_0 (1 + d(s J# e)/dq - N),     t = K_0 p constant in the first term.
/// Null: there are none. `wrenches` without load, and an error of zero, add nothing.
JointMatrix stiffness_under_load(const DynamicsResult& robot, const Impedance& impedance, Load load,
                                 const TipWrenches& wrenches,
                                 const LoadedPosture* posture = nullptr) noexcept;

/// Adds an environment's springs and dampers to an impedance.
void add_environment(const Environment& environment, Impedance& impedance) noexcept;

/// Returns viscous friction less the slope at rest of its compensation at the measured velocity, n,
/// N m s/rad: the joints' own damping of small motions without Coulomb friction. See
/// FeedForward::friction_share.
JointVector friction_left(const RobotModel& model, const Settings& settings);

/// Sets P to N, which projects joint velocities on the null space.
void null_projector(const NullSpace& null_space, JointMatrix& P) noexcept;

/// C += L D L' with the D of the null space's ratio, see NullSpace::ratio_damping.
void add_null_damping(const NullSpace& null_space, JointMatrix& C) noexcept;

/// K += P' diag(k) P
void add_projected(const JointMatrix& P, const JointVector& k, JointMatrix& K) noexcept;

/// Posture of an arm with posture springs or dampers, and their references, with which N and J#
/// turn.
struct Posture {
  const DynamicsKernel* kernel;
  const JointVector* q;  ///< n, rad
  JointVector error;     ///< p = q_0 - q - s J# e, n; see ImpedanceLaw
  JointVector velocity;  ///< qd_0, n, rad/s
};

/// All that acts on a robot, except its environment.
struct Acting {
  const Impedance& impedance;
  const NullSpace& null_space;
  const JointVector& friction;  ///< the joints' own damping, n, N m s/rad
  TipWrenches wrenches;
  std::optional<Posture> posture = {};  ///< none: N stands still
};

/// Sets `system` to the robot with all that acts on it and the environment of the settings, M q'' +
/// C q' + K q = f, linearised where the springs are at rest (e = 0, q = q_d, q = q_0) and N stands
/// still:
///     K = K_q + J' K_C J + N' K_0 N  [+ J' C_C Jdot + N' C_0 d(N (qd - qd_0))/dq]
///         [+ the part of a load]
///     C = C_q + J' C_C J + N' C_0 N + friction.
/// The task_terms of the settings select the terms in brackets; a load adds nothing if the world
/// exerts no wrench. Without these terms K is symmetric and has its factor W. The feed-forward does
/// not appear, because it depends on the set-point, not on the state, except for Coriolis and
/// gravity, which cancel the robot's Coriolis and gravity torques.
void closed_loop(const DynamicsResult& robot, const JointVector& qd, const Acting& acting,
                 const Settings& settings, analysis::System<kMaxJoints>& system) noexcept;

}  // namespace dashpot::controller
