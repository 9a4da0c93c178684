#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/tune/tuned_loop.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/input_error.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

namespace dashpot::apps {
namespace {

using controller::InputError;
using controller::JointVector;
using controller::Mode;
using text::Range;
using text::YamlMapping;
using text::YamlNode;

/// Includes the text of the URDF, so that each arm is made from the same text.
controller::RobotDescription with_text(controller::RobotDescription robot) {
  if (robot.text.empty()) robot.text = controller::read_urdf_file(robot.urdf);
  return robot;
}

constexpr int kMostDelay = controller::Analysis::Sampled::kMostDelay;
constexpr double kMostPayload = 1e3;    // kg
constexpr Range kMargin{1, true, 1e6};  // of gain
constexpr Range kUpToMillion{0, true, 1e6};

template <class Value>
using Choices = std::array<std::pair<std::string_view, Value>, 2>;

/// Removes keys that are null, and replaces null in lists by "none".
Json without_nulls(Json json, int depth = 0) {
  constexpr int kDeepest = 8;  // a design has four levels
  if (!json.is_structured()) return json;
  if (depth > kDeepest) throw controller::InputError("", "lists are nested too deeply");
  for (auto at = json.begin(); at != json.end();) {
    if (at->is_null() && json.is_object()) {
      at = json.erase(at);
      continue;
    }
    *at = at->is_null() ? Json("none") : without_nulls(*at, depth + 1);
    ++at;
  }
  return json;
}

/// Returns the gains of one part as a configuration has them. {"ratio": Z} is its damping_ratio;
/// F of {"factor": F}, of sqrt(stiffness), is left to `factor`.
Json part_of(const Json& design, const char* stiffness, const char* damping, double& factor) {
  static constexpr auto kKeys = text::key_list("factor", "ratio");
  Json part = Json::object();
  if (design.contains(stiffness)) part["stiffness"] = design[stiffness];
  if (!design.contains(damping)) return part;
  const Json& given = design[damping];
  if (!given.is_object()) {
    part["damping"] = given;
    return part;
  }
  const YamlNode document = yaml_of(given);
  const YamlMapping keys(document, std::string(damping) + ".", kKeys);
  if (keys.has("ratio")) {
    part["damping_ratio"] = given["ratio"];
    return part;
  }
  if (!keys.has("factor")) throw keys.error("factor", "missing");
  read_number(keys, "factor", "", kUpToMillion, factor);
  return part;
}

/// Returns F sqrt(K), entry by entry, as an audit does.
template <class Matrix>
Matrix of_root(double factor, const Matrix& K) {
  return factor * K.cwiseMax(0).cwiseSqrt();
}

controller::Gains gains_of(const Json& design, const controller::RobotModel& model) {
  static constexpr auto kKeys = text::key_list("gains");
  double task = 0, joint = 0, null_space = 0;
  Json parts = {{"task", part_of(design, "stiffness", "damping", task)},
                {"joint", part_of(design, "joint_stiffness", "joint_damping", joint)},
                {"null_space", part_of(design, "null_stiffness", "null_damping", null_space)}};
  if (design.contains("frame")) parts["task"]["frame"] = design["frame"];
  const YamlNode document = yaml_of({{"gains", parts}});
  controller::Gains gains = controller::read_gains({document, "", kKeys}, model);
  if (task > 0) gains.task_damping = of_root(task, gains.task_stiffness);
  if (joint > 0) gains.joint_damping = of_root(joint, gains.joint_stiffness);
  if (null_space > 0) gains.null_damping = of_root(null_space, gains.null_stiffness);
  return gains;
}

Json matrix_json(const Eigen::MatrixXd& matrix) {
  const Eigen::MatrixXd diagonal = matrix.diagonal().asDiagonal();
  return matrix == diagonal ? json_list(matrix.diagonal()) : json_rows(matrix);
}

Json damping_json(double ratio, const Eigen::MatrixXd& damping) {
  if (ratio > 0) return {{"ratio", ratio}};
  return matrix_json(damping);
}

/// Gains and loop as the controller would have them.
controller::Settings settings_of(const TunedArm& arm, const controller::AuditOptions& stated) {
  controller::Settings settings = arm.settings();
  set_timing(stated, settings);
  settings.watchdog.longest_gap = std::max(settings.watchdog.longest_gap, 2.5 * settings.period);
  settings.motion.smoothing =
      std::min(settings.motion.smoothing, controller::kMostSmoothing * settings.period);
  settings.limits.gain_margin = stated.margin;
  settings.initial.mode = stated.mode;
  settings.null_weights = stated.null_weights;
  controller::Gains gains = stated.gains;
  if (stated.half_quaternion) gains.task_stiffness.bottomRightCorner<3, 3>() *= 0.5;
  if (stated.mode == Mode::kCartesian) {  // the joint gains do not matter
    gains.joint_stiffness = arm.settings().initial.gains.joint_stiffness;
    gains.joint_damping = arm.settings().initial.gains.joint_damping;
    gains.joint_damping_ratio = arm.settings().initial.gains.joint_damping_ratio;
  }
  settings.initial.gains = gains;
  return settings;
}

}  // namespace

Json robot_keys(const controller::RobotDescription& robot) {
  const controller::ModelOptions plain, &options = robot.options;
  Json keys = Json::object();
  if (options.gravity != plain.gravity) keys["gravity"] = json_list(options.gravity);
  if (!options.include_off_chain) keys["include_off_chain"] = false;
  if (options.accept_inertias) keys["accept_inertias"] = true;
  if (!options.accept_inertias_of.empty()) keys["accept_inertias"] = options.accept_inertias_of;
  if (!options.drives.empty()) keys["drives"] = options.drives;
  for (const auto& [key, values] :
       {std::pair("reflected_inertia", &options.reflected_inertia),
        {"torque_loop_inertia_ratio", &options.torque_loop_inertia_ratio},
        {"viscous_friction", &options.viscous_friction},
        {"coulomb_friction", &options.coulomb_friction},
        {"gear_stiffness", &options.gear_stiffness},
        {"gear_damping", &options.gear_damping}}) {
    if (values->size() > 0) keys[key] = json_list(*values);
  }
  if (keys.contains("gear_stiffness")) {
    for (Json& one : keys["gear_stiffness"]) {
      if (!one.is_number() || std::isinf(one.get<double>())) one = "none";
    }
  }
  if (options.position_sensor == controller::PositionSensor::kLink) {
    keys["position_sensor"] = "link";
  }
  const controller::Payload& payload = options.payload;
  if (payload.mass > 0) {
    keys["payload"] = {{"mass", payload.mass}, {"center", json_list(payload.center)}};
    if (!payload.inertia.isZero(0)) keys["payload"]["inertia"] = json_rows(payload.inertia);
  }
  const Eigen::Matrix3d& R = options.tool.rotation;
  if (!options.tool.position.isZero(0) || !R.isIdentity(0)) {
    const Eigen::Vector3d rpy{std::atan2(R(2, 1), R(2, 2)),
                              std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0))),
                              std::atan2(R(1, 0), R(0, 0))};
    keys["tool"] = {{"position", json_list(options.tool.position)}, {"rpy", json_list(rpy)}};
  }
  return keys;
}

YamlNode yaml_of(const Json& json) {
  return text::parse_made_yaml(without_nulls(json).dump());
}

TunedArm::TunedArm(controller::RobotDescription robot, const controller::Settings* settings)
    : robot_(with_text(std::move(robot))),
      model_(robot_.model()),
      settings_(settings != nullptr ? *settings : controller::default_settings(model_)),
      own_settings_(settings != nullptr),
      torque_guessed_(!own_settings_ && settings_.limits.torque.isZero(0)) {
  if (torque_guessed_) settings_.limits.torque.setConstant(100);
}

TunedArm TunedArm::with(const Json& parts) const {
  static constexpr auto kKeys = text::key_list("payload", "reflected_inertia", "viscous_friction",
                                               "gear_stiffness", "gear_damping", "position_sensor");
  const YamlNode document = yaml_of(parts);
  const YamlMapping keys(document, "arm.", kKeys);
  controller::RobotDescription robot = robot_;
  if (keys.has("payload")) robot.options.payload = {};
  controller::read_joint_options(keys, model_, robot.options);
  if (robot.options.payload.mass > kMostPayload) throw keys.error("payload", "is too heavy");
  return {std::move(robot), own_settings_ ? &settings_ : nullptr};
}

bool TunedDesign::designed() const {
  const controller::Gains& gains = stated.gains;
  if (stated.mode == Mode::kJoint) return gains.joint_damping_ratio > 0;
  return gains.task_damping_ratio > 0 || gains.null_damping_ratio > 0;
}

TunedDesign read_design(const TunedArm& arm, const Json& design) {
  static constexpr auto kKeys =
      text::key_list("mode", "frame", "stiffness", "damping", "joint_stiffness", "joint_damping",
                     "null_stiffness", "null_damping", "null_projector", "null_weights", "rotation",
                     "inertia_blocks", "period", "delay", "cutoff", "difference_velocity",
                     "integral_time", "ideal_gravity", "gain_margin", "arm");
  const YamlNode document = yaml_of(design);
  const YamlMapping keys(document, "", kKeys);
  TunedDesign result;
  controller::AuditOptions& stated = result.stated;
  stated.gains = gains_of(without_nulls(design), arm.model());
  read_choice(keys, "mode",
              Choices<Mode>{{{"cartesian", Mode::kCartesian}, {"joint", Mode::kJoint}}},
              stated.mode);
  read_choice(keys, "rotation", Choices<bool>{{{"vector", false}, {"half-quaternion", true}}},
              stated.half_quaternion);
  read_choice(keys, "null_projector", controller::kNullProjectors, stated.gains.null_projector);
  const int n = arm.model().dof();
  stated.null_weights.setOnes(n);
  read_numbers(keys, "null_weights", text::Units(static_cast<std::size_t>(n)), text::kPositive,
               stated.null_weights);
  read_switch(keys, "inertia_blocks", stated.inertia_blocks);
  stated.period = arm.settings().period;
  read_number(keys, "period", "s", {0, true, 1}, stated.period);
  read_count(keys, "delay", 0, stated.delay);
  if (stated.delay > kMostDelay) throw keys.error("delay", "is longer than 20 ticks");
  read_number(keys, "cutoff", "Hz", kUpToMillion, stated.cutoff);
  read_switch(keys, "difference_velocity", stated.difference_velocity);
  read_number(keys, "integral_time", "s", kUpToMillion, stated.integral_time);
  read_switch(keys, "ideal_gravity", stated.ideal_gravity);
  stated.margin = arm.settings().limits.gain_margin;
  read_number(keys, "gain_margin", "", kMargin, stated.margin);
  if (result.designed() && stated.inertia_blocks) {
    throw InputError("damping",
                     "is designed for a ratio by Dashpot's controller alone, which has no gains "
                     "times the tip's inertia");
  }
  result.settings = settings_of(arm, stated);
  if (result.designed()) stated.settings = result.settings;
  return result;
}

Json design_json(const TunedArm& arm) {
  const controller::Settings& settings = arm.settings();
  const controller::Gains& gains = settings.initial.gains;
  const auto& sampled = settings.analysis.sampled;
  const int n = arm.model().dof();
  const auto of_joints = [n](const JointVector& values) {
    return json_list(values.size() == n ? values : JointVector(JointVector::Zero(n)));
  };
  const JointVector null_damping =
      gains.null_damping.size() == n ? gains.null_damping : JointVector(JointVector::Zero(n));
  return {{"mode", settings.initial.mode == Mode::kJoint ? "joint" : "cartesian"},
          {"frame", gains.frame == controller::Frame::kTool ? "tool" : "base"},
          {"stiffness", matrix_json(gains.task_stiffness)},
          {"damping", damping_json(gains.task_damping_ratio, gains.task_damping)},
          {"joint_stiffness", matrix_json(gains.joint_stiffness)},
          {"joint_damping", damping_json(gains.joint_damping_ratio, gains.joint_damping)},
          {"null_stiffness", of_joints(gains.null_stiffness)},
          {"null_damping",
           damping_json(gains.null_damping_ratio, Eigen::MatrixXd(null_damping.asDiagonal()))},
          {"null_projector", name_of(gains.null_projector)},
          {"null_weights", of_joints(settings.null_weights)},
          {"period", settings.period},
          {"delay", sampled.delay},
          {"cutoff", sampled.cutoff},
          {"difference_velocity", sampled.difference_velocity},
          {"integral_time", settings.integral.time},
          {"ideal_gravity", !settings.feed_forward.gravity},
          {"gain_margin", settings.limits.gain_margin},
          {"arm", Json::object()}};
}

}  // namespace dashpot::apps
