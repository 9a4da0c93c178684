#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/law/spring_integral.hpp>
#include <dashpot/controller/motion/reference.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// How far a deflection of the tip may have moved the joints before the posture springs count less
/// of it, rad (m).
inline constexpr double kPostureShare = 0.3;

/// Computes the joint torque of springs and dampers between robot and reference, and of the
/// feed-forward:
///
///     tau = K_q (q_d - q) + C_q (qd_d - qd) + w_q M qdd_d           joint impedance
///         + J' (K_C e + C_C (V_d - J qd) + w_C Lambda Vd_d + f)     Cartesian impedance, wrench
///         + N' K_0 (q_0 - q - s J# e) + N' C_0 N (qd_0 - qd)        redundancy
///         + t + J' f_I                                              integral of the springs
///         + friction + coriolis + gravity                           the robot
///
/// e = (p_d - p, rotation vector of R_d R'), in B's axes at the tip: linear, then angular. K_C is
/// the sum of the stiffness given in B's axes and R K_T R' for the stiffness K_T given in the
/// tool's axes, and C_C likewise. w_q and w_C are the shares of the two modes, 0 or 1 except while
/// the mode changes; K_q and C_q, K_C and C_C, K_0 and C_0 contain them. Lambda = (J M^-1 J')^-1 in
/// the selected directions (see TaskInertia); N and J# = M^-1 J' Lambda are explained in NullSpace.
/// f is the commanded wrench, and t and f_I are explained in SpringIntegral. Friction is
///     friction_i = viscous_friction_i v_i + coulomb_friction_i tanh(v_i / 0.01 rad/s)
/// at v = w_q qd_d + w_C (joint velocity that takes the tip along V_d), or, at the measured v = qd,
/// FeedForward::friction_share times this with FeedForward::friction_rise for 0.01 rad/s. J# e is
/// the part of q_0 - q that a deflection of the tip explains. It is subtracted, because otherwise
/// deflections of the tip would drive the self-motion, and the stiffness of the loop would not be
/// symmetric. It counts fully while it is small: s = 1 / sqrt(1 + (|J# e| / 0.3 rad)^2). Every term
/// of the last column can be left out, see FeedForward.
///
/// K_C acts on e within the error clamp (see ErrorClamp): a tip that is further away is pulled no
/// harder.
///
/// The torque is bounded wherever the arm is, because J', N (see NullSpace) and e are bounded. Only
/// Lambda is divided by something that vanishes at a singularity, and it is damped there.
class ImpedanceLaw {
 public:
  ImpedanceLaw(const RobotModel& model, const FeedForward& feed_forward,
               const SpringIntegral& integral = SpringIntegral(Integral(), 0),
               const analysis::BorneDamping* borne = nullptr);

  /// Sets `tau` to the joint torque. `wrench` is f, which counts only if FeedForward::wrench is on.
  void torque(const DynamicsResult& robot, const JointVector& q, const JointVector& qd,
              const Impedance& impedance, const SpringReferences& references, const Vector6& wrench,
              const ErrorClamp& clamp, JointVector& tau) noexcept;

  /// Forgets the last orientation error: the next one is the short way round.
  void reset() noexcept { orientation_.reset(); }

  /// Lets the integral take in the springs of the last torque, or what `change` allows of it.
  void integrate(SpringIntegral::Change change) noexcept;
  SpringIntegral& integral() noexcept { return integral_; }
  const SpringIntegral& integral() const noexcept { return integral_; }

  /// Return terms of the last torque: e, the wrench of its Cartesian part, and the null space,
  /// which is up to date if the impedance has null-space springs or dampers.
  const Vector6& tip_error() const noexcept { return e_; }
  /// The part of the torque that comes from dampers, n.
  const JointVector& dampers() const noexcept { return dampers_; }
  const Vector6& tip_wrench() const noexcept { return F_; }
  /// q_0 - q - s J# e, n; without entries where the null space has no springs or dampers.
  const JointVector& posture_error() const noexcept { return posture_error_; }
  const NullSpace& null_space() const noexcept { return null_space_; }
  /// Returns the factor of the mass matrix of the last torque; null if it was not needed.
  const SmallCholesky* mass() const noexcept { return mass_known_ ? &null_space_.mass() : nullptr; }
  /// Returns what the loop left of the null space's damping ratio.
  const analysis::DampingLevel& null_level() const noexcept { return null_level_; }

 private:
  /// K_C e + C_C (V_d - J qd) + w_C Lambda Vd_d; sets `tip_damping_` to the second.
  Vector6 task_wrench(const DynamicsResult& robot, const JointVector& qd,
                      const Impedance& impedance, const TipReference& path,
                      const ErrorClamp& clamp) noexcept;
  /// dq -= s J# e
  void subtract_posture_share(JointVector& dq) const noexcept;
  void add_friction(const JointVector& velocity, JointVector& tau) const noexcept;

  FeedForward feed_forward_;
  bool friction_of_reference_, friction_of_robot_;
  double friction_rise_;  ///< rad/s; over this Coulomb friction changes sign smoothly
  JointVector viscous_friction_;
  JointVector coulomb_friction_;
  OrientationError orientation_;
  Vector6 e_ = Vector6::Zero();
  Vector6 F_ = Vector6::Zero();
  NullSpace null_space_;
  bool mass_known_ = false;
  analysis::DampingLevel null_level_;
  SpringIntegral integral_;
  bool clamped_ = false;  ///< the error clamp acts
  JointVector dampers_;
  JointVector posture_error_;
  Vector6 tip_damping_ = Vector6::Zero();
  JointVector joint_pull_;  ///< K_q (q_d - q)
  Vector6 tip_pull_ = Vector6::Zero();
  const analysis::BorneDamping* borne_;
};

}  // namespace dashpot::controller
