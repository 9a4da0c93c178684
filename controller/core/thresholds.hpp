#pragma once

namespace dashpot::controller {

/// More restarts of the springs than this within about a second come from a recurring fault.
inline constexpr double kMostRestarts = 3;
/// While no state can be trusted, the last known weight is held for this time, s. Robots engage
/// their brakes within a few tenths of it. Later that weight might drive the arm.
inline constexpr double kWeightHeld = 2;
/// A joint rests below this share of its velocity limit; noisy sensors stay below it.
inline constexpr double kAtRest = 0.01;
/// With a lower TipSpeed::limit references keep to this share of it, because SafetyFilter takes
/// drive away from 0.65 of it on.
inline constexpr double kShareOfTipLimit = 0.6;
/// The tip's reference moves each joint with at most this share of its velocity limit at the
/// robot's posture; the remaining share is for vibrations and the null space.
inline constexpr double kShareOfJointLimit = 0.4;

/// Time in which that share of the tip's speed rises by 1, s. Next to a singularity it changes
/// several times within a degree, and without this bound it would shake the arm at 9 Hz.
inline constexpr double kShareRise = 1;

}  // namespace dashpot::controller
