#include <dashpot/controller/posture.hpp>

#include <cmath>
#include <numbers>
#include <sstream>

namespace dashpot::controller {
namespace {

bool inside(const Joint& joint, double q, double tolerance) {
  return q >= joint.lower - tolerance && q <= joint.upper + tolerance;
}

/// Whether q fits if it is in degrees.
bool fits_degrees(const RobotModel& model, const JointVector& q, double tolerance) {
  for (int i = 0; i < model.dof(); ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    const bool turns = joint.type != JointType::kPrismatic;
    if (!inside(joint, turns ? q[i] * std::numbers::pi / 180 : q[i], tolerance)) return false;
  }
  return true;
}

}  // namespace

JointVector middle_posture(const RobotModel& model) {
  JointVector q(model.dof());
  for (int i = 0; i < model.dof(); ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    const double sum = joint.lower + joint.upper;
    q[i] = std::isfinite(sum) ? 0.5 * sum : 0;
  }
  return q;
}

std::string outside_limits(const RobotModel& model, const JointVector& q, double tolerance) {
  for (int i = 0; i < model.dof(); ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    if (inside(joint, q[i], tolerance)) continue;
    const char* unit = joint.type == JointType::kPrismatic ? " m" : " rad";
    std::ostringstream line;
    line << "joint '" << joint.name << "' at " << q[i] << unit << " is outside its limits "
         << joint.lower << " to " << joint.upper << unit;
    if (fits_degrees(model, q, tolerance))
      line << "; if these are degrees, give each number its unit: 'deg'";
    return line.str();
  }
  return "";
}

}  // namespace dashpot::controller
