#pragma once
// The thresholds of controller/core, and why they are what they are.

namespace dashpot::controller {

/// Springs that restart more often than this within about a second hunt a fault that comes back.
inline constexpr double kMostRestarts = 3;
/// Where no state can be trusted, the last known weight is held for so long, s: robots engage their
/// brakes within a few tenths of that. Later nobody knows whether it holds the arm or drives it.
inline constexpr double kWeightHeld = 2;
/// A joint rests below this share of its velocity limit: sensors that are noisy stay below it.
inline constexpr double kAtRest = 0.01;
/// With a lower TipSpeed::limit references keep to this share of it, because SafetyFilter takes
/// drive away from 0.65 of it on.
inline constexpr double kShareOfTipLimit = 0.6;
/// The tip's reference takes each joint to at most this share of its velocity limit where the robot
/// is: what is left is for vibrations and the null space.
inline constexpr double kShareOfJointLimit = 0.4;

/// In so many s that share of the tip's speed rises by 1. Next to a singularity it changes several
/// times over within a degree, so a share that followed the joints would shake the arm at 9 Hz.
inline constexpr double kShareRise = 1;

}  // namespace dashpot::controller
