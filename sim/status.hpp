#pragma once
#include <cstdint>

namespace dashpot::sim {

/// Outcome of one tick of the plant. Unless it is kOk, motion, sensors and clock stay where they
/// were.
enum class Status : std::uint8_t {
  kOk,
  kCommandWrongSize,  ///< the torque command has not n entries
  kCommandNotFinite,  ///< the torque command has a NaN or an infinity
  kStateNotFinite,    ///< the motion left the numbers: unstable step, or no inertia
  kNotConverged,      ///< Newton's iteration of an implicit step reached its cap
  kTooManySteps,      ///< the adaptive step size went to zero, or the cap on steps was reached
};

/// A short English text, without a full stop.
const char* to_text(Status status) noexcept;

}  // namespace dashpot::sim
