#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/posture.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

namespace dashpot::controller {
namespace {

bool inside(const Joint& joint, double q, double tolerance) {
  return q >= joint.lower - tolerance && q <= joint.upper + tolerance;
}

/// Returns true if q is inside the limits when it is read in degrees.
bool fits_degrees(const RobotModel& model, const JointVector& q, double tolerance) {
  for (int i = 0; i < model.dof(); ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    const bool turns = joint.type != JointType::kPrismatic;
    if (!inside(joint, turns ? q[i] * std::numbers::pi / 180 : q[i], tolerance)) return false;
  }
  return true;
}

constexpr double kSingular = 0.02;     // of the largest singular value of J, in m and rad
constexpr double kWellRegular = 0.05;  // likewise, for a default posture

Eigen::MatrixXd jacobian(const RobotModel& model, const JointVector& q) {
  return evaluate(model, q, JointVector::Zero(model.dof())).J;
}

/// The smallest singular value as a share of the largest.
double regularity(const Eigen::MatrixXd& J) {
  const Eigen::VectorXd values = Eigen::JacobiSVD<Eigen::MatrixXd>(J).singularValues();
  return values[values.size() - 1] / values[0];
}

}  // namespace

JointVector default_posture(const RobotModel& model) {
  constexpr int kTried = 256;
  JointVector middle(model.dof());
  for (int i = 0; i < model.dof(); ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    const double sum = joint.lower + joint.upper;
    middle[i] = std::isfinite(sum) ? 0.5 * sum : 0;
  }
  if (regularity(jacobian(model, middle)) >= kWellRegular) return middle;
  const PostureSequence postures(model.joint_values(&Joint::lower),
                                 model.joint_values(&Joint::upper));
  JointVector nearest = middle;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kTried; ++k) {
    const JointVector q = postures.at(k);
    const double distance = (q - middle).norm();
    if (distance >= least || regularity(jacobian(model, q)) < kWellRegular) continue;
    nearest = q;
    least = distance;
  }
  return nearest;
}

std::string lost_directions(const RobotModel& model, const JointVector& q) {
  static constexpr std::array<const char*, 6> kNames = {"x", "y", "z", "rx", "ry", "rz"};
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(jacobian(model, q), Eigen::ComputeFullU);
  std::ostringstream text;
  text.precision(2);
  for (Eigen::Index k = 0; k < svd.singularValues().size(); ++k) {
    if (svd.singularValues()[k] > kSingular * svd.singularValues()[0]) continue;
    Eigen::VectorXd u = svd.matrixU().col(k);
    Eigen::Index largest = 0;
    u.cwiseAbs().maxCoeff(&largest);
    u /= u[largest];
    text << (text.tellp() > 0 ? ", " : "") << kNames[static_cast<std::size_t>(largest)];
    for (Eigen::Index i = 0; i < 6; ++i) {
      if (i == largest || std::abs(u[i]) < 0.05) continue;
      text << (u[i] < 0 ? " - " : " + ") << std::abs(u[i]) << ' '
           << kNames[static_cast<std::size_t>(i)];
    }
  }
  return text.str();
}

std::string too_heavy(const RobotModel& model, const JointVector& q) {
  const JointVector weight = evaluate(model, q, JointVector::Zero(model.dof())).gravity;
  const JointVector effort = model.joint_values(&Joint::effort);
  Eigen::Index worst = -1;
  for (Eigen::Index i = 0; i < weight.size(); ++i) {
    const bool held = !(effort[i] > 0) || std::abs(weight[i]) <= effort[i];
    if (held) continue;
    if (worst < 0 || std::abs(weight[i]) * effort[worst] > std::abs(weight[worst]) * effort[i]) {
      worst = i;
    }
  }
  if (worst < 0) return "";
  const Joint& joint = model.joints()[static_cast<std::size_t>(worst)];
  const char* unit = joint.type == JointType::kPrismatic ? " N" : " N m";
  std::ostringstream line;
  line.precision(4);
  line << "the arm cannot hold itself here: joint '" << joint.name << "' needs "
       << std::abs(weight[worst]) << unit << ", its effort limit is " << joint.effort << unit;
  if (model.attachment().mass > 0) line << " (the payload is " << model.attachment().mass << " kg)";
  return line.str();
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
    if (std::abs(weight[i]) > settings.limits.torque[i]) {
      line << "joint '" << joint.name << "' needs " << std::abs(weight[i])
           << " N m to hold the arm and its payload here, limits.torque allows "
           << settings.limits.torque[i];
      return line.str();
    }
    if (torque.size() == 0 || std::isinf(largest)) continue;
    const double friction = kFriction * settings.limits.torque[i] + joint.coulomb_friction;
    if (std::abs(torque[i] - weight[i]) <= friction + largest) continue;
    line << "joint '" << joint.name << "' holds " << torque[i]
         << ", but the model's weight there is " << weight[i]
         << " N m: is the base tilted, the payload another, or does the torque not hold the arm? "
            "watchdog.start_torque: none accepts any";
    return line.str();
  }
  return "";
}

namespace {

/// The number after `state` of the generator SplitMix64 (Steele, Lea and Flood 2014), in [0, 1).
double next_share(std::uint64_t& state) {
  std::uint64_t z = state += 0x9e3779b97f4a7c15;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return std::ldexp(static_cast<double>((z ^ (z >> 31)) >> 11), -53);
}

}  // namespace

PostureSequence::PostureSequence(const JointVector& lower, const JointVector& upper,
                                 std::uint64_t seed)
    : lower_(lower.cwiseMax(-std::numbers::pi)),
      upper_(upper.cwiseMin(std::numbers::pi)),
      step_(lower.size()),
      offset_(JointVector::Zero(lower.size())) {
  double phi = 1.5;
  const double root = 1.0 / static_cast<double>(lower.size() + 1);
  for (int k = 0; k < 60; ++k) phi = std::pow(phi + 1, root);  // contracts by at least 1/3
  for (Eigen::Index i = 0; i < step_.size(); ++i) {
    step_[i] = std::pow(phi, -static_cast<double>(i + 1));
    if (seed != 0) offset_[i] = next_share(seed);
    if (lower_[i] <= upper_[i]) continue;
    if (lower[i] > 0) {  // both limits are beyond half a turn; the upper one may be infinite
      upper_[i] = std::min(upper[i], lower[i] + 2 * std::numbers::pi);
    } else {
      lower_[i] = std::max(lower[i], upper[i] - 2 * std::numbers::pi);
    }
  }
}

JointVector PostureSequence::at(std::int64_t index) const {
  JointVector q(step_.size());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const double share = offset_[i] + static_cast<double>(index + 1) * step_[i];
    q[i] = lower_[i] + (share - std::floor(share)) * (upper_[i] - lower_[i]);
  }
  return q;
}

}  // namespace dashpot::controller
