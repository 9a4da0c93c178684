#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/text/printable.hpp>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <exception>
#include <sstream>

namespace dashpot::controller {
namespace {

constexpr double kMostInertia = 100;  // kg m^2, of a joint: no arm has more

const Joint& joint_of(const RobotModel& model, int i) {
  return model.joints()[static_cast<std::size_t>(i)];
}

/// Returns two digits, rounded up, as a suggestion needs no more.
std::string rounded_up(double value) {
  const double unit = std::pow(10, std::floor(std::log10(value)) - 1);
  return text::number(unit * std::ceil(value / unit - 1e-9), 2);
}

}  // namespace

UnknownRotors unknown_rotors(const RobotModel& model) {
  UnknownRotors unknown;
  for (int i = 0; i < model.dof(); ++i) {
    if (joint_of(model, i).reflected_inertia == 0) unknown.joints.push_back(i);
  }
  if (unknown.any()) unknown.published = drives_like(model);
  return unknown;
}

RobotModel with_at_least(const RobotModel& model, const JointVector& inertia) {
  return model.with_reflected_inertia(
      model.joint_values(&Joint::reflected_inertia).cwiseMax(inertia));
}

std::optional<JointVector> enough_reflected_inertia(
    const RobotModel& model, const analysis::System<>& loop, double period,
    const std::function<bool(const RobotModel&)>& keeps) {
  const UnknownRotors unknown = unknown_rotors(model);
  if (!unknown.any()) return std::nullopt;
  // In an arm with elastic joints the links come first: the joints without inertia are rigid.
  const Eigen::VectorXd resists = loop.mass.inverse().diagonal().head(model.dof()).cwiseInverse();
  JointVector demand = JointVector::Zero(model.dof());
  double first = std::numeric_limits<double>::infinity(), largest = 0;
  for (const int i : unknown.joints) {
    demand[i] = period * loop.damping(i, i) + period * period * loop.stiffness(i, i);
    if (demand[i] > 0) first = std::min(first, resists[i] / demand[i]);
    largest = std::max(largest, demand[i]);
  }
  const auto inertia = [&](double share) {
    return JointVector(
        (share * demand - JointVector(resists))
            .cwiseMax(0)
            .cwiseMin(
                (demand.array() > 0).select(JointVector::Constant(model.dof(), kMostInertia), 0)));
  };
  const auto enough = [&](double share) {
    try {
      return keeps(with_at_least(model, inertia(share)));
    } catch (const std::exception&) {
      return false;
    }
  };
  if (!(largest > 0)) return std::nullopt;
  double low = first, high = 2 * first;
  while (!enough(high)) {
    if (high * largest > kMostInertia) return std::nullopt;
    low = high;
    high *= 2;
  }
  for (int k = 0; k < 8; ++k) {
    const double middle = std::sqrt(low * high);
    (enough(middle) ? high : low) = middle;
  }
  return inertia(high);
}

std::string missing_rotors_text(const RobotModel& model) {
  const UnknownRotors unknown = unknown_rotors(model);
  if (!unknown.any()) return "";
  std::string names;
  for (const int i : unknown.joints) {
    names += (names.empty() ? "" : ", ") + text::printable(joint_of(model, i).name);
  }
  const bool all = static_cast<int>(unknown.joints.size()) == model.dof();
  return "the model has no reflected inertia of " + (all ? "any joint" : names);
}

std::string unit_text(const RobotModel& model, const std::string& turns,
                      const std::string& slides) {
  const auto count =
      std::count_if(model.joints().begin(), model.joints().end(),
                    [](const Joint& joint) { return joint.type == JointType::kPrismatic; });
  if (count == 0) return turns;
  return count == model.dof() ? slides : turns + " (" + slides + ")";
}

std::string inertia_text(const RobotModel& model, const JointVector& inertia) {
  std::string text;
  for (int i = 0; i < model.dof(); ++i) {
    if (!(inertia[i] > 0)) continue;
    text += (text.empty() ? "" : ", ") + text::printable(joint_of(model, i).name) + " " +
            rounded_up(inertia[i]);
  }
  return text + " " + unit_text(model, "kg m^2", "kg");
}

std::string arm_without_rotors(const RobotModel& model) {
  const bool all = static_cast<int>(unknown_rotors(model).joints.size()) == model.dof();
  return all ? "an arm without rotors" : "an arm without rotors in these joints";
}

std::string drives_text(const RobotModel& model, const std::string& name) {
  if (name.empty()) return "";
  if (is_drives_file(name)) return "Drives " + name + ".";
  const Drives* like = drives_like(model);
  return "Drives " + name + ", public figures: " + std::string(find_drives(name).doubt) + "." +
         (like != nullptr && like->name != name
              ? " This arm looks like " + std::string(like->name) + "."
              : "");
}

std::string friction_text(const RobotModel& model) {
  const JointVector friction = model.joint_values(&Joint::viscous_friction);
  if (friction.isZero(0)) return "";
  std::ostringstream text;
  text << "Viscous friction in the joints, " << friction.minCoeff();
  if (friction.maxCoeff() > friction.minCoeff()) text << " to " << friction.maxCoeff();
  text << " " << unit_text(model, "N m s/rad", "N s/m") << ", damps beside the gains.";
  return text.str();
}

std::string rotors_hint(const RobotModel& model, const std::string& inertia_option,
                        const std::string& drives_option, const std::string& between) {
  const UnknownRotors unknown = unknown_rotors(model);
  std::string hint = inertia_option +
                     " takes the inertia of rotor and gear at the joint (rotor times gear ratio "
                     "squared):" +
                     between +
                     "from the maker, `armature` of a MuJoCo model, or dashpot calibrate.";
  if (unknown.published == nullptr) {
    std::string names;
    for (const Drives& drives : published_drives()) {
      if (drives.joints != model.dof()) continue;
      names += (names.empty() ? "" : ", ") + std::string(drives.name);
    }
    if (names.empty()) return hint;
    return hint + between + "Public figures by name: " + drives_option + " " + names + ".";
  }
  return hint + between + "Public figures of such an arm, with their doubts: " + drives_option +
         " " + std::string(unknown.published->name) + ".";
}

analysis::Gears elastic_joints(const RobotModel& model) {
  const Eigen::VectorXd friction = model.joint_values(&Joint::viscous_friction);
  return analysis::Gears({model.joint_values(&Joint::gear_stiffness),
                          model.joint_values(&Joint::gear_damping),
                          model.joint_values(&Joint::reflected_inertia), friction.asDiagonal(),
                          model.position_sensor() == PositionSensor::kLink});
}

}  // namespace dashpot::controller
