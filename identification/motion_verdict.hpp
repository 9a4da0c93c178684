#pragma once
#include <dashpot/identification/motion_record.hpp>

namespace dashpot::identification {

/// The kind of a record's motion: how its modes are identified, or why they cannot be.
enum class MotionKind { kDecays, kAmbient, kDriven, kLimitCycle, kLargeMotion, kNothing };

struct MotionVerdict {
  MotionKind kind = MotionKind::kNothing;
  double frequency = 0;  ///< rad/s: of a limit cycle, or the pace of other motion
  double harmonics = 0;  ///< of a limit cycle: share of its squares at multiples of the frequency
};

/// Tells by the outputs alone what kind of motion a record shows: nothing beyond noise; a limit
/// cycle, which repeats itself with one amplitude in the second half of the record; lasting motion
/// under unmeasured forces, whose energy rises as often as it falls; or anything else, which may
/// contain free decays. Scales of time and of the channels, offsets and slow drift make no
/// difference.
///
/// Throws std::invalid_argument as identify_decays.
MotionVerdict judge_motion(const MotionRecord& record);

}  // namespace dashpot::identification
