#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Doubts a brake that acts alone and does not stop the arm: because of velocities that are late or
/// torques of the wrong sign it may feed the arm instead. The kinetic energy may exceed the least
/// since the brake began by what the weight can have given, int |w_i qd_i| dt over about half a
/// second, as if all of it were held wrongly, and by that of joints with half of their
/// velocity limits (at least 1 rad/s), each by itself: somebody may push the arm.
class BrakeDoubt {
 public:
  explicit BrakeDoubt(const Limits& limits) noexcept : velocity_(limits.velocity) {}
  /// The brake begins.
  void reset() noexcept { least_ = -1; }
  /// Returns true if the arm has more kinetic energy than is right, `dt` after the last call.
  bool grows(double dt, const DynamicsResult& robot, const JointVector& qd) noexcept;

 private:
  JointVector velocity_;  ///< limits, n, rad/s
  double least_ = -1;     ///< kinetic energy, J; below zero: not known
  double given_ = 0;      ///< by the weight, J
};

}  // namespace dashpot::controller
