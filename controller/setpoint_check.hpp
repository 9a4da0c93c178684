#pragma once
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// What is wrong with a set-point: the member's name, and why; null pointers if nothing is.
struct SetpointFault {
  const char* key = nullptr;
  const char* reason = nullptr;

  explicit operator bool() const noexcept { return key != nullptr; }
};

/// Whether springs and dampers are those of an arm of n joints, for the mode they are needed in:
/// sizes, finite, of at most 1e9, symmetric within 1e-9 and positive semidefinite within 1e-10 of
/// the largest entry. null_stiffness and null_damping may have no entries: then they are zero.
SetpointFault check_gains(const Gains& gains, Mode mode, Eigen::Index n) noexcept;

/// Whether a controller of an arm can go there: gains as above, and goals that are finite, within
/// the position limits, at most 1e6 m away, not beyond a wall, and rotations within 1e-6. In mode
/// kCartesian joint_position may have no entries: then the posture stays where it is. With
/// `known_gains` the gains have passed before and are not checked again.
SetpointFault check_setpoint(const Setpoint& setpoint, const Limits& limits,
                             bool known_gains = false) noexcept;

/// True if sizes and entries are equal. Gains without NaN are expected.
bool same_gains(const Gains& a, const Gains& b) noexcept;

}  // namespace dashpot::controller
