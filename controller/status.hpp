#pragma once
#include <cstdint>

namespace dashpot::controller {

/// Outcome of one tick: of several, the one that stands last here. Each comes with its safe output.
///   hold:  the springs stop where they are, whatever the set-point says; no commanded wrench
///   damp:  no springs: joint damping, and gravity where the controller compensates it
///   ramp:  the last good torque goes to zero within 0.1 s
/// Torque and torque-rate limits hold for all of them. Where damp and ramp take torque away, it
/// fades evenly: in all joints alike, as slowly as the slowest torque-rate limit makes it.
///
/// Recovery: what `status` names has to be over; nothing else is needed. After a ramp of at most
/// Watchdog::longest_gap the controller goes on where it was. After a longer ramp and after every
/// damp it starts afresh: springs where the robot is, gains growing from zero within
/// Motion::gain_time, and set-points moving from there. Snapshot::restarts counts these.
enum class Status : std::uint8_t {
  kOk,
  // The torque is as asked for, as far as it goes:
  kTorqueLimited,    ///< a torque or torque-rate limit is at work
  kNearJointLimit,   ///< a joint is within the margin of a position limit; its repulsion is at work
  kWrenchNotFinite,  ///< NaN or infinity in RobotState::external_wrench; the last finite one stays
                     ///< in force, in the analysis, which alone uses it
  kSetpointRejected,  ///< set-point with a NaN, a wrong size, indefinite gains, a rotation that is
                      ///< none, an unreachable joint position or a time to come; the last good one
                      ///< stays in force
  // The set-point is too old:
  kSetpointStale,  ///< older than the first time-out: hold
  kSetpointLost,   ///< older than the second time-out: damp
  // The state cannot go on like this:
  kTimeGap,        ///< more than the longest gap since the last tick: damp
  kVelocityLimit,  ///< a joint moves faster than its limit: damp, until slower than 0.8 of it
  kPositionLimit,  ///< a joint is outside its position limits: damp, and push back
  // The state cannot be trusted:
  kStateNotFinite,  ///< NaN or infinity: ramp
  kStateWrongSize,  ///< not n entries: ramp
  kStateJump,       ///< a position or velocity further from the last than the robot can move: ramp
  kTimeBackward,    ///< time stamp at or before that of the last tick: ramp
  kNotFinite,       ///< the law gave a NaN or infinity: ramp
};

/// The one that stands last.
inline Status worse(Status a, Status b) noexcept {
  return a < b ? b : a;
}

/// "ok", "torque limited", ...: a short English text.
const char* to_text(Status status) noexcept;

}  // namespace dashpot::controller
