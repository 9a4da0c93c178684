#pragma once
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// What is wrong with a set-point: the name of the member, and the reason; null pointers if nothing
/// is wrong.
struct SetpointFault {
  const char* key = nullptr;
  const char* reason = nullptr;

  explicit operator bool() const noexcept { return key != nullptr; }
};

/// Returns what is wrong with the springs and dampers of an arm of n joints in mode `mode`. They
/// must have the right sizes, be finite and at most 1e9, and matrices must be symmetric within 1e-9
/// and positive semidefinite within 1e-10 of the largest entry. null_stiffness and null_damping may
/// have no entries, which stands for zero.
SetpointFault check_gains(const Gains& gains, Mode mode, Eigen::Index n) noexcept;

/// Returns what is wrong with a set-point. Gains must pass check_gains. Goals must be finite,
/// within the position limits, at most 1e6 m away and not beyond a wall, and rotations must be
/// rotations within 1e-6. In mode kCartesian joint_position may have no entries, which keeps the
/// posture. With `known_gains` the gains are not checked, because they have passed before.
SetpointFault check_setpoint(const Setpoint& setpoint, const Limits& limits,
                             bool known_gains = false) noexcept;

/// Returns true if sizes and entries of the gains of a mode are equal. They must not contain NaN.
bool same_gains(const Gains& a, const Gains& b, Mode mode) noexcept;
/// Returns true if this is so for both modes.
inline bool same_gains(const Gains& a, const Gains& b) noexcept {
  return same_gains(a, b, Mode::kJoint) && same_gains(a, b, Mode::kCartesian);
}

}  // namespace dashpot::controller
