#pragma once
#include <cstdint>

namespace dashpot::sim {

/// Result of one tick of the plant. Unless it is kOk, motion, sensors and clock do not change.
enum class Status : std::uint8_t {
  kOk,
  kCommandWrongSize,  ///< the torque command does not have n entries
  kCommandNotFinite,  ///< the torque command has a NaN or an infinity
  kStateNotFinite,    ///< the motion is no longer finite: unstable step, or no inertia
  kNotConverged,      ///< Newton's iteration of an implicit step reached its cap
  kTooManySteps,      ///< the adaptive step size went to zero, or the cap on steps was reached
};

/// Returns a short English text, without a full stop.
const char* to_text(Status status) noexcept;

}  // namespace dashpot::sim
