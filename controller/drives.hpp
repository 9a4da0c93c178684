#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace dashpot::controller {

/// Values of an arm's drives, which a URDF cannot contain: published ones, none of which was
/// measured on the arm at hand, or the values of a file, with their source and the doubts about
/// them.
struct Drives {
  static constexpr int kMost = kMaxJoints;

  std::string_view name;  ///< "fr3", or the path of the file
  int joints;
  std::array<double, kMost> reflected_inertia;  ///< kg m^2; zero: unknown
  std::array<double, kMost> viscous_friction;   ///< N m s/rad; zeros: not published
  std::array<double, kMost> coulomb_friction;   ///< N m; likewise
  std::string_view source, doubt;

  JointVector values(const std::array<double, kMost>& all) const;
};

/// Returns all published drives.
std::span<const Drives> published_drives() noexcept;

/// Returns `name`; the path of a drives file (.yaml or .yml) begins at `directory`.
std::string drives_name(std::string_view name, const std::filesystem::path& directory);
/// Returns true if `name` names a drives file.
bool is_drives_file(std::string_view name) noexcept;

/// Returns the drives of this name, or the drives in a file that `dashpot calibrate` writes: YAML
/// with `reflected_inertia`, and `viscous_friction`, `coulomb_friction`, `source` and `doubt` if
/// they are known, each number with or without its unit. Throws InvalidModel, which lists the names
/// or says what is wrong with the file.
const Drives& find_drives(std::string_view name);
/// The same; throws unless they have n joints as well.
const Drives& find_drives(std::string_view name, int n);

/// Returns true if `name` names a drives file with friction, which replaces the URDF's unless
/// something else is specified. Throws InvalidModel.
bool has_own_friction(std::string_view name);

/// Returns the first drives with as many joints whose name begins the name of the model, of its
/// first joint or of its base: values of an arm of this kind. Null if there are none.
const Drives* drives_like(const RobotModel& model) noexcept;

}  // namespace dashpot::controller
