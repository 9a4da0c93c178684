#pragma once
#include <cstdint>

namespace dashpot::controller {

/// Result of one tick. If several conditions hold, the most severe, the last in this list, is
/// returned. From kSetpointStale on each comes with a safe output:
///   hold:  the springs stop where they are, whatever the set-point says; no commanded wrench.
///   damp:  no springs: the brake (see Brake), which holds the arm once it stands, and the arm's
///          weight where the controller compensates it.
///   ramp:  the last torque for Watchdog::longest_gap; then the last known weight, with a brake for
///          the motion that the model predicts from the last good state; after 2 s the torque goes
///          to zero within 0.1 s. Before the first good state it stays constant for these 2 s.
/// Torque and torque-rate limits hold for all of them. Where damp and ramp take torque away, it
/// fades evenly: in all joints alike, as slowly as the slowest torque-rate limit makes it.
///
/// Faults latch. A status whose safe output is "damp" (but kSetpointLost), or "ramp" or
/// kTimeBackward for longer than Watchdog::longest_gap, leaves a fault behind: the arm stays
/// braked, with its weight held (the weight alone as long as the state is frozen, and where the
/// brake is doubted), the status is kFaultLatched or worse, and Snapshot::fault names the fault.
/// This ends with Controller::release or reset, or, if Watchdog::release_after is set, once the arm
/// has been at rest for that long. Then, as after a lost set-point, the springs start where the
/// robot is, with gains that grow from zero within Motion::gain_time; Snapshot::restarts counts
/// these restarts. After a ramp of at most Watchdog::longest_gap the controller continues where it
/// was.
enum class Status : std::uint8_t {
  kOk,
  // The torque is the wanted one as far as possible:
  kTorqueLimited,     ///< a limit of torque, torque rate, power, speed or energy is at work
  kNearJointLimit,    ///< the brake keeps a joint from going beyond a position limit
  kLittleMargin,      ///< springs too stiff for the sampled loop, or a damping ratio too small for
                      ///< them: no share of the ratio keeps Limits::gain_margin at this posture
  kWrenchNotFinite,   ///< NaN or infinity in RobotState::external_wrench; the last finite wrench
                      ///< stays in the analysis. With Limits::external_force: kCollision
  kSetpointRejected,  ///< set-point with a NaN, a wrong size, indefinite gains, an invalid rotation
                      ///< matrix, a goal beyond a limit or wall, or a time further ahead than the
                      ///< first time-out; the last good set-point stays
  kWeightNotHeld,     ///< the weight of the arm needs more than a torque limit: the arm sinks
  // The set-point is too old:
  kSetpointStale,  ///< older than the first time-out: hold
  kSetpointLost,   ///< older than the second time-out: damp
  // The state cannot go on like this: damp, and the fault latches:
  kFaultLatched,        ///< none of the following is present, but one was and was not released
  kTooManyRestarts,     ///< the springs restarted more than three times within about a second
  kTimeGap,             ///< more than the longest gap since the last tick
  kWrongRate,           ///< ticks come at less than 2/3 or more than 3/2 of the configured rate
  kCollision,           ///< an external torque or force above its threshold
  kInstability,         ///< a vibration, or a torque that reverses in every tick or two
  kTipSpeedLimit,       ///< the tip moves faster than its limit
  kVelocityLimit,       ///< a joint moves faster than its limit
  kWall,                ///< the tip is beyond a wall that it must not cross
  kPositionLimit,       ///< a joint is outside its position limits; it may return slowly
  kStateFrozen,         ///< the state does not change at all, though the torque does or the
                        ///< velocity is not zero: weight alone
  kStateContradictory,  ///< positions do not move as the velocities say
  kTimeBackward,        ///< a time stamp not after the last one; it counts as a period. For at
                        ///< most Watchdog::longest_gap this changes no torque
  kBrakeDoubted,  ///< the brake alone acts, and the arm gets faster or vibrates: weight alone.
                  ///< The robot needs its own brakes
  // The state cannot be trusted: ramp:
  kStateNotFinite,  ///< NaN or infinity
  kStateWrongSize,  ///< not n entries
  kStateJump,       ///< a position or velocity further from the last than the robot can move
  kNotFinite,       ///< the law gave a NaN or infinity
};

/// Returns the more severe of two statuses, the last one in the list above.
inline Status worse(Status a, Status b) noexcept {
  return a < b ? b : a;
}

/// Returns true if a status latches as soon as it happens. A status whose output is "ramp" latches
/// only after Watchdog::longest_gap.
inline bool latches(Status status) noexcept {
  return status > Status::kFaultLatched && status < Status::kStateNotFinite;
}

/// Returns true if a tick's status, with the latched fault, requires the robot's brakes: no torque
/// is known to be right, or the state is lost for so long that a fault has latched.
inline bool needs_brakes(Status status, Status fault) noexcept {
  return status == Status::kStateFrozen || status == Status::kStateContradictory ||
         status == Status::kBrakeDoubted ||
         (status >= Status::kStateNotFinite && fault != Status::kOk);
}

/// Returns a short English text: "ok", "torque limited", ...
const char* to_text(Status status) noexcept;

}  // namespace dashpot::controller
