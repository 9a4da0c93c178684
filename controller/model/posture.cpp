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

std::string start_fault(const RobotModel& model, const Settings& settings, const JointVector& q,
                        const JointVector& torque, const JointVector& weight) {
  constexpr double kOutside = 0.1;    // rad (m): stops give way, and files are cautious
  constexpr double kFriction = 0.05;  // of a torque limit
  const std::string outside = outside_limits(model, q, kOutside);
  if (!outside.empty()) return outside + " (a start is given in rad and m)";
  const double largest = settings.watchdog.start_torque * weight.cwiseAbs().maxCoeff();
  std::ostringstream line;
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    const double lower = settings.limits.position_lower[i] - 2 * std::numbers::pi;
    const double upper = settings.limits.position_upper[i] + 2 * std::numbers::pi;
    if (q[i] < lower || q[i] > upper) {
      line << "joint '" << joint.name << "' at " << q[i]
           << " is more than a turn outside its limits "
           << "of position; degrees? A start is given in rad and m";
      return line.str();
    }
    if (torque.size() == 0 || std::isinf(largest)) continue;
    const double friction = kFriction * settings.limits.torque[i] + joint.coulomb_friction;
    if (std::abs(torque[i] - weight[i]) <= friction + largest) continue;
    line << "joint '" << joint.name << "' holds " << torque[i]
         << ", but the model's weight there is " << weight[i]
         << " N m: is the base tilted, the payload another, or the torque none that holds the arm? "
            "watchdog.start_torque: none accepts any";
    return line.str();
  }
  return "";
}

}  // namespace dashpot::controller
