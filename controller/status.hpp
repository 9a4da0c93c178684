#pragma once
#include <cstdint>

namespace dashpot::controller {

/// Outcome of one tick. Every status comes with the safe output that stands beside
/// it.
///   hold:  springs stay where they are, whatever the set-point says
///   damp:  no springs; gravity (where the controller compensates it) and joint damping
///   ramp:  the last good torque goes to zero at the torque-rate limit, or within 0.1 s if that is
///   slower
enum class Status : std::uint8_t {
  kOk,
  // The torque is as asked for, as far as it goes:
  kTorqueLimited,   ///< a torque or torque-rate limit is at work
  kNearJointLimit,  ///< a joint is within the margin of a position limit; its repulsion is at work
  kSetpointRejected,  ///< set-point with a NaN, a wrong size, indefinite gains or an unreachable
                      ///< joint position; the last good one stays in force
  // The set-point is too old:
  kSetpointStale,  ///< older than the first time-out: hold
  kSetpointLost,   ///< older than the second time-out: damp
  // The state cannot be trusted:
  kStateNotFinite,  ///< NaN or infinity: ramp
  kStateWrongSize,  ///< not n entries: ramp
  kStateJump,       ///< a position or velocity further from the last than the robot can move: ramp
  kTimeBackward,    ///< time stamp at or before the last one: ramp
  kTimeGap,         ///< more than the longest gap since the last one: damp
  kVelocityLimit,   ///< a joint moves faster than its limit: damp
  kPositionLimit,   ///< a joint is outside its position limits: damp, and push back
  kNotFinite,       ///< the law gave a NaN or infinity: ramp
};

/// "ok", "torque limited", ...: a short English text.
const char* to_text(Status status) noexcept;

}  // namespace dashpot::controller
