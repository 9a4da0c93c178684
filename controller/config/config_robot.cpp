#include <dashpot/controller/config.hpp>
#include <dashpot/controller/drives.hpp>

#include <Eigen/Geometry>
#include <limits>
#include <numbers>

namespace dashpot::controller {
namespace {

void read_payload(const text::YamlMapping& robot, Payload& payload) {
  static constexpr auto kKeys = text::key_list("mass", "center", "inertia");
  const text::YamlMapping keys = robot.mapping("payload", kKeys);
  read_number(keys, "mass", "kg", text::kNotNegative, payload.mass);
  read_vector3(keys, "center", "m", payload.center);
  read_matrix(keys, "inertia", text::Units(3, "kg m^2"), payload.inertia);
  if (payload.mass == 0 && !(payload.center.isZero(0) && payload.inertia.isZero(0))) {
    throw robot.error("payload", "has a centre or inertia, and no mass");
  }
}

void read_tool(const text::YamlMapping& robot, Pose& tool) {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  static constexpr auto kKeys = text::key_list("position", "rpy");
  const text::YamlMapping keys = robot.mapping("tool", kKeys);
  Vector3d rpy = Vector3d::Zero();
  read_vector3(keys, "position", "m", tool.position);
  read_vector3(keys, "rpy", "rad", rpy);
  if (rpy.cwiseAbs().maxCoeff() > 2 * std::numbers::pi) {
    throw keys.error("rpy", "has an angle beyond a turn, in rad; degrees are written as '90 deg'");
  }
  tool.rotation = (AngleAxisd(rpy.z(), Vector3d::UnitZ()) * AngleAxisd(rpy.y(), Vector3d::UnitY()) *
                   AngleAxisd(rpy.x(), Vector3d::UnitX()))
                      .toRotationMatrix();
}

/// true, false, or a list of links.
void read_accepted(const text::YamlMapping& robot, ModelOptions& options) {
  const text::YamlNode* node = robot.find("accept_inertias");
  if (node == nullptr || node->kind != text::YamlNode::Kind::kSequence) {
    read_switch(robot, "accept_inertias", options.accept_inertias);
    return;
  }
  for (const text::YamlNode& item : node->items) {
    if (item.kind != text::YamlNode::Kind::kScalar) {
      throw robot.error("accept_inertias", "true, false or names of links are wanted");
    }
    options.accept_inertias_of.push_back(item.text);
  }
}

std::string required_text(const text::YamlMapping& root, const text::YamlMapping& robot,
                          std::string_view key) {
  if (!robot.has(key)) throw robot.error(key, "missing", root.line("robot"));
  std::string text;
  read_text(robot, key, text);
  return text;
}

void read_joint_option(const text::YamlMapping& robot, std::string_view key,
                       const text::Units& units, JointVector& option,
                       const text::Range& range = text::kNotNegative, double none = text::kNoNone) {
  if (!robot.has(key)) return;
  option.resize(static_cast<Eigen::Index>(units.size()));
  read_numbers(robot, key, units, range, option, none);
}

/// Reads the options of elastic joints, and of torque controllers inside the drives.
void read_gears(const text::YamlMapping& keys, const RobotModel& model, ModelOptions& options) {
  read_joint_option(keys, "torque_loop_inertia_ratio", joint_units(model, "", ""),
                    options.torque_loop_inertia_ratio, text::Range{0, false, 1});
  if (options.torque_loop_inertia_ratio.size() > 0 && options.reflected_inertia.size() == 0 &&
      model.joint_values(&Joint::reflected_inertia).isZero(0)) {
    throw keys.error("torque_loop_inertia_ratio", "needs reflected_inertia, kg m^2, or drives");
  }
  read_joint_option(keys, "gear_stiffness", joint_units(model, "N m/rad", "N/m"),
                    options.gear_stiffness, text::kPositive,
                    std::numeric_limits<double>::infinity());
  read_joint_option(keys, "gear_damping", joint_units(model, "N m s/rad", "N s/m"),
                    options.gear_damping);
  if (keys.has("gear_damping") && options.gear_stiffness.size() == 0) {
    throw keys.error("gear_damping", "needs gear_stiffness, N m/rad");
  }
  read_choice(keys, "position_sensor",
              std::array<std::pair<std::string_view, PositionSensor>, 2>{
                  {{"motor", PositionSensor::kMotor}, {"link", PositionSensor::kLink}}},
              options.position_sensor);
}

/// Stores the drives that the keys name in `robot`, and returns its model.
RobotModel read_drives(const text::YamlMapping& keys, const std::filesystem::path& directory,
                       RobotDescription& robot) {
  read_switch(keys, "drives_friction", robot.options.drives_friction);
  if (robot.options.drives_friction && !keys.has("drives")) {
    throw keys.error("drives_friction", "needs drives");
  }
  if (!keys.has("drives")) return robot.model();
  std::string name;
  read_text(keys, "drives", name);
  name = drives_name(name, directory);
  try {
    find_drives(name);
  } catch (const InvalidModel& error) {
    throw keys.error("drives", error.what());
  }
  robot.options.drives = name;
  if (!keys.has("drives_friction")) robot.options.drives_friction = has_own_friction(name);
  return robot.model();
}

}  // namespace

text::Units joint_units(const RobotModel& model, const char* revolute, const char* prismatic) {
  text::Units units;
  for (const Joint& joint : model.joints()) {
    units.emplace_back(joint.type == JointType::kPrismatic ? prismatic : revolute);
  }
  return units;
}

void read_joint_options(const text::YamlMapping& keys, const RobotModel& model,
                        ModelOptions& options) {
  read_payload(keys, options.payload);
  const text::Units damping = joint_units(model, "N m s/rad", "N s/m");
  read_joint_option(keys, "reflected_inertia", joint_units(model, "kg m^2", "kg"),
                    options.reflected_inertia);
  read_joint_option(keys, "viscous_friction", damping, options.viscous_friction);
  read_joint_option(keys, "coulomb_friction", joint_units(model, "N m", "N"),
                    options.coulomb_friction);
  read_gears(keys, model, options);
}

RobotDescription read_robot(const text::YamlMapping& root, const std::filesystem::path& directory,
                            const std::string& text) try {
  static constexpr auto kKeys =
      text::key_list("urdf", "base", "tip", "gravity", "include_off_chain", "accept_inertias",
                     "reflected_inertia", "drives", "drives_friction", "viscous_friction",
                     "coulomb_friction", "torque_loop_inertia_ratio", "gear_stiffness",
                     "gear_damping", "position_sensor", "payload", "tool");
  const text::YamlMapping keys = root.mapping("robot", kKeys);
  RobotDescription robot;
  robot.urdf = directory / required_text(root, keys, "urdf");
  robot.base = required_text(root, keys, "base");
  robot.tip = required_text(root, keys, "tip");
  robot.text = text;
  ModelOptions& options = robot.options;
  read_vector3(keys, "gravity", "m/s^2", options.gravity);
  read_switch(keys, "include_off_chain", options.include_off_chain);
  read_accepted(keys, options);
  read_payload(keys, options.payload);
  read_tool(keys, options.tool);

  // The kinds of the joints are known once there is a model; some inertia makes any model possible.
  RobotDescription preliminary = robot;
  const text::YamlNode* inertia = keys.find("reflected_inertia");
  if (inertia != nullptr && inertia->items.size() <= kMaxJoints) {
    preliminary.options.reflected_inertia.setOnes(static_cast<Eigen::Index>(inertia->items.size()));
  }
  const RobotModel model = read_drives(keys, directory, preliminary);
  options.drives = preliminary.options.drives;
  if (keys.has("drives")) options.reflected_inertia = model.joint_values(&Joint::reflected_inertia);
  if (preliminary.options.drives_friction) {
    options.viscous_friction = model.joint_values(&Joint::viscous_friction);
    options.coulomb_friction = model.joint_values(&Joint::coulomb_friction);
  }
  read_joint_options(keys, model, options);
  robot.model();  // throws what is wrong with it
  return robot;
} catch (const InvalidModel& error) {
  throw root.error("robot", error.what());
}

}  // namespace dashpot::controller
