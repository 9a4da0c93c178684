#pragma once
#include <cstdint>

namespace dashpot::sim {

/// A spring with a damper in parallel that only pushes: force = max(0, k d + c d') while the depth
/// d is positive. A body that leaves it faster than the spring follows loses the spring's energy.
struct Contact {
  double stiffness = 0;  ///< k >= 0, N/m or N m/rad
  double damping = 0;    ///< c >= 0, N s/m or N m s/rad

  /// Both side by side.
  Contact& operator+=(const Contact& other) noexcept {
    stiffness += other.stiffness;
    damping += other.damping;
    return *this;
  }
  bool operator==(const Contact&) const = default;
};

enum class ContactMode : std::uint8_t {
  kFree,      ///< no depth
  kReleased,  ///< depth, but no force: it leaves faster than the spring follows
  kPressing,
};

inline ContactMode contact_mode(const Contact& contact, double depth, double rate) noexcept {
  if (depth <= 0) return ContactMode::kFree;
  return contact.stiffness * depth + contact.damping * rate > 0 ? ContactMode::kPressing
                                                                : ContactMode::kReleased;
}

/// Force, and the power that the contact turns into heat; within one mode both are smooth.
struct ContactForce {
  double force = 0;  ///< N or N m
  double loss = 0;   ///< W, >= 0
};

inline ContactForce contact_force(const Contact& contact, ContactMode mode, double depth,
                                  double rate) noexcept {
  switch (mode) {
    case ContactMode::kPressing:
      return {contact.stiffness * depth + contact.damping * rate, contact.damping * rate * rate};
    case ContactMode::kReleased:
      return {0, -contact.stiffness * depth * rate};
    case ContactMode::kFree:
      break;
  }
  return {};
}

/// J
inline double contact_energy(const Contact& contact, double depth) noexcept {
  return depth > 0 ? 0.5 * contact.stiffness * depth * depth : 0;
}

}  // namespace dashpot::sim
