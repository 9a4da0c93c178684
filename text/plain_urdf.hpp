#pragma once
#include <limits>
#include <map>
#include <string>
#include <string_view>

namespace dashpot::text {

/// Limits of a joint that URDF has from version 1.2 on, rad/s^2 and rad/s^3 (or m); infinity where
/// the file states none.
struct MotionLimits {
  double acceleration = std::numeric_limits<double>::infinity();
  double deceleration = std::numeric_limits<double>::infinity();
  double jerk = std::numeric_limits<double>::infinity();
};

/// A URDF as a parser of version 1.0 reads it, and the data that this version lacks.
struct PlainUrdf {
  std::string text;
  std::map<std::string, MotionLimits, std::less<>>
      limits;  ///< by joint; only those that are stated
  /// By joint, the required values that its limit lacks: "effort", "velocity" or both, which are 0
  /// in `text`.
  std::map<std::string, std::string, std::less<>> lacks;
  /// By joint, `reflected_inertia` of its dynamics, kg m^2 (kg), an attribute of Dashpot's own.
  std::map<std::string, double, std::less<>> reflected_inertia;
  /// By joint, the `rpy` of its origin if an angle exceeds a turn, as degrees do.
  std::map<std::string, std::string, std::less<>> turns;
};

/// Checks a URDF of version 1.0, 1.1 or 1.2 as check_xml does, and returns it in version 1.0 with
/// nothing but what the mechanics of a chain need: shapes, materials, transmissions and extensions
/// are left out unread. `quat_xyzw` of version 1.1 becomes `rpy`, exactly but for rounding. Throws
/// std::runtime_error with the reason for other versions, for `quat_xyzw` in version 1.0, where
/// other programs ignore it, for invalid rotations, for limits that are not positive, and for MJCF,
/// SDF and xacro. Such a message names the next step and the file as `name`.
PlainUrdf plain_urdf(std::string_view text, const std::string& name);

}  // namespace dashpot::text
