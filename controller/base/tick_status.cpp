#include <dashpot/controller/tick_status.hpp>

namespace dashpot::controller {

const char* to_text(Status status) noexcept {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kTorqueLimited:
      return "torque, torque rate, power, speed or energy limited";
    case Status::kNearJointLimit:
      return "near a joint's position limit";
    case Status::kLittleMargin:
      return "springs leave the sampled loop too little gain margin";
    case Status::kWrenchNotFinite:
      return "external wrench not finite, the last one stays";
    case Status::kSetpointRejected:
      return "set-point rejected";
    case Status::kWeightNotHeld:
      return "torque limit below the arm's weight";
    case Status::kSetpointStale:
      return "set-point stale, holding";
    case Status::kSetpointLost:
      return "set-point lost, damping";
    case Status::kFaultLatched:
      return "fault latched, damping until released";
    case Status::kTooManyRestarts:
      return "springs restarted too often, damping";
    case Status::kTimeGap:
      return "gap between states, damping";
    case Status::kWrongRate:
      return "loop at the wrong rate, damping";
    case Status::kCollision:
      return "collision, damping";
    case Status::kInstability:
      return "vibration, damping";
    case Status::kTipSpeedLimit:
      return "tip speed limit exceeded, damping";
    case Status::kVelocityLimit:
      return "velocity limit exceeded, damping";
    case Status::kWall:
      return "tip beyond a wall, damping";
    case Status::kPositionLimit:
      return "position limit exceeded, damping";
    case Status::kStateFrozen:
      return "state frozen, holding the weight";
    case Status::kStateContradictory:
      return "position and velocity contradict each other, damping";
    case Status::kTimeBackward:
      return "time not after the last, damping";
    case Status::kBrakeDoubted:
      return "the brake does not stop the arm, holding the weight: engage the robot's brakes";
    case Status::kStateNotFinite:
      return "state not finite, torque ramped down";
    case Status::kStateWrongSize:
      return "state of wrong size, torque ramped down";
    case Status::kStateJump:
      return "state jumped, torque ramped down";
    case Status::kNotFinite:
      return "torque not finite, ramped down";
  }
  return "unknown status";
}

}  // namespace dashpot::controller
