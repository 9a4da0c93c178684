#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <array>
#include <span>
#include <string>
#include <string_view>

namespace dashpot::controller {

/// Public figures of an arm's drives, which a URDF has no place for. Each has its source, and what
/// is doubtful about it: none was measured on the arm at hand.
struct Drives {
  static constexpr int kMost = 7;  ///< joints

  std::string_view name;  ///< "fr3"
  int joints;
  std::array<double, kMost> reflected_inertia;  ///< kg m^2, positive
  std::array<double, kMost> viscous_friction;   ///< N m s/rad; zeros: none is published
  std::array<double, kMost> coulomb_friction;   ///< N m; likewise
  std::string_view source, doubt;

  JointVector values(const std::array<double, kMost>& all) const;
};

/// Returns all that are known.
std::span<const Drives> published_drives() noexcept;

/// Returns the drives of this name. Throws InvalidModel, which lists the names, if there are none.
const Drives& find_drives(std::string_view name);
/// The same; throws unless they have n joints as well.
const Drives& find_drives(std::string_view name, int n);

/// Returns the first drives whose name begins the model's, or that of its first joint or base,
/// with as many joints: figures of an arm of this kind. Null if there are none.
const Drives* drives_like(const RobotModel& model) noexcept;

}  // namespace dashpot::controller
