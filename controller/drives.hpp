#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace dashpot::controller {

/// Figures of an arm's drives, which a URDF has no place for: public ones, of which none was
/// measured on the arm at hand, or those of a file. Each has its source, and what is doubtful about
/// it.
struct Drives {
  static constexpr int kMost = kMaxJoints;

  std::string_view name;  ///< "fr3", or the path of the file
  int joints;
  std::array<double, kMost> reflected_inertia;  ///< kg m^2; zero: not known
  std::array<double, kMost> viscous_friction;   ///< N m s/rad; zeros: none is published
  std::array<double, kMost> coulomb_friction;   ///< N m; likewise
  std::string_view source, doubt;

  JointVector values(const std::array<double, kMost>& all) const;
};

/// Returns all that are known.
std::span<const Drives> published_drives() noexcept;

/// Returns `name`, as a path from `directory` on if it is a drives file's: ends with .yaml or .yml.
std::string drives_name(std::string_view name, const std::filesystem::path& directory);
/// True if `name` is one of a drives file.
bool is_drives_file(std::string_view name) noexcept;

/// Returns the drives of this name, or those of a drives file, which `dashpot calibrate` writes:
/// YAML with `reflected_inertia`, and `viscous_friction`, `coulomb_friction`, `source` and `doubt`
/// if they are known. Throws InvalidModel, which lists the names or tells what is wrong with the
/// file.
const Drives& find_drives(std::string_view name);
/// The same; throws unless they have n joints as well.
const Drives& find_drives(std::string_view name, int n);

/// Returns the first drives whose name begins the model's, or that of its first joint or base,
/// with as many joints: figures of an arm of this kind. Null if there are none.
const Drives* drives_like(const RobotModel& model) noexcept;

}  // namespace dashpot::controller
