#pragma once
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Integral action of the springs, see Integral: joint torques t for the springs of mode kJoint, a
/// wrench f at the tip for the springs of mode kCartesian. With P the pull of the springs (K_q (q_d
/// - q), or K_C e within the error clamp), a tick adds T / time P after its torque:
///     t_k+1 = t_k + T / time P_k,
/// and then t_i is clamped to +-Integral::torque, and force and moment of f are shortened to their
/// bounds.
///
/// The store ends when its purpose ends:
/// - It stands still while the springs are in `hold`.
/// - It does not grow while a limit changes the torque (status kTorqueLimited, kNearJointLimit or
///   kWeightNotHeld) or the error clamp acts; it may shrink.
/// - It fades to zero evenly while gains or mode change, because springs may end in directions in
///   which it pulls, and while payload or tool change, because the model takes over the weight that
///   it holds, and its wrench acts at another point.
/// - It is zero where springs start: after a fault, a lost set-point, a release or a reset.
///
/// An arm that is let go after it was held or stopped therefore deflects at most as far as the
/// bound deflects its springs, and returns with about the time constant `time`.
class SpringIntegral {
 public:
  SpringIntegral(const Integral& settings, double period) noexcept;

  bool on() const noexcept { return rate_ > 0; }
  void reset() noexcept;
  /// Does a tick with these pulls of the springs (n; 6, in B's axes). The pull of inactive springs
  /// has to be zero. If `may_grow` is false, it may only shrink.
  void step(const JointVector& joint_pull, const Vector6& tip_pull, bool may_grow) noexcept;
  /// Does a tick of a fade to zero; `ticks`, at least 1, remain.
  void fade(double ticks) noexcept;

  const JointVector& torque() const noexcept { return torque_; }  ///< t, n, N m
  const Vector6& wrench() const noexcept { return wrench_; }      ///< f, N and N m

 private:
  double rate_;  ///< T / time
  double force_, moment_;
  JointVector bound_;
  JointVector torque_;
  Vector6 wrench_ = Vector6::Zero();
};

}  // namespace dashpot::controller
