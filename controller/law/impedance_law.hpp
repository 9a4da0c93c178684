#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/law/spring_integral.hpp>
#include <dashpot/controller/motion/reference.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Deflection of the joints by the tip, rad (m), above which the posture springs compensate less of
/// it.
inline constexpr double kPostureShare = 0.3;

/// A torque of the law, and its parts.
struct LawTorque {
  JointVector torque;                    ///< n, N m
  JointVector dampers;                   ///< the part that comes from dampers, n, N m
  JointVector joint_pull;                ///< K_q (q_d - q), n, N m
  Vector6 tip_pull = Vector6::Zero();    ///< K_C e within the error clamp
  Vector6 tip_error = Vector6::Zero();   ///< e
  Vector6 tip_wrench = Vector6::Zero();  ///< of the Cartesian part
  JointVector posture_error;             ///< q_0 - q - s J# e, n; no entries without null space
  bool clamped = false;                  ///< the error clamp acts; set with an integral only
};

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
/// symmetric. It counts fully while it is small: s = 1 / sqrt(1 + (|J# e| / 0.3 rad)^2). Without a
/// projector N = I and J# = 0; damping for a ratio that all springs have then acts on the velocity
/// error of joints that move the tip at V_d, qd_0 + M^-1 J' Lambda (V_d - J qd_0) - qd. Every term
/// of the last column can be left out, see FeedForward.
///
/// K_C acts on e within the error clamp (see ErrorClamp): a tip that is further away is pulled no
/// harder.
///
/// The torque is bounded wherever the arm is, because J', N (see NullSpace) and e are bounded. Only
/// Lambda is divided by something that vanishes at a singularity, and it is damped there.
class ImpedanceLaw {
 public:
  ImpedanceLaw(const RobotModel& model, const FeedForward& feed_forward);

  struct Input {
    const DynamicsResult& robot;
    const JointVector &q, &qd;
    const Impedance& impedance;
    const NullSpace& null_space;  ///< of these; unused without springs at the tip
    const SpringReferences& references;
    const ErrorClamp& clamp;
    const Vector6& wrench;                     ///< f; counts only if FeedForward::wrench is on
    const SpringIntegral* integral = nullptr;  ///< none, or one that is on
  };
  void torque(const Input& now, LawTorque& result) noexcept;

  /// Forgets the last orientation error: the next one is the short way round, as it is where
  /// springs at the tip begin.
  void reset() noexcept { orientation_.reset(); }

 private:
  /// Sets e and K_C e, and the wrench K_C e + C_C (V_d - J qd) + w_C Lambda Vd_d, of which it
  /// returns the second term.
  Vector6 pull_tip(const Input& now, LawTorque& result) noexcept;
  /// Returns N' K_0 (q_0 - q - s J# e) + N' C_0 N (qd_0 - qd); the first term has no damper.
  static void add_null_torque(const Input& now, LawTorque& result) noexcept;

  FeedForward feed_forward_;
  bool measured_;  ///< friction is compensated at the measured velocity, not the reference's
  JointVector viscous_friction_;
  JointVector coulomb_friction_;
  OrientationError orientation_;
};

}  // namespace dashpot::controller
