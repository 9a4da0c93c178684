#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/tune/tuned_design.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/robot_model.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <sstream>
#include <string_view>

namespace dashpot::apps {
namespace {

using controller::InputError;
using controller::JointVector;
using controller::Mode;
using TuneJson = nlohmann::ordered_json;

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    throw controller::InvalidModel(path + ": cannot be read");
  }
  return text.str();
}

constexpr double kMostDelay = 20;  ///< ticks, as for the controller; more takes seconds

/// Refuses other keys than these.
void check_keys(const std::string& of, const TuneJson& object,
                std::initializer_list<std::string_view> keys) {
  if (!object.is_object()) throw InputError(of, "is no object");
  for (const auto& [key, value] : object.items()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      throw InputError(std::string(of).append(".").append(key), "is no key");
    }
  }
}

/// The value of a key, or null.
const TuneJson& value_at(const TuneJson& object, const char* key) {
  static const TuneJson none;
  const auto found = object.find(key);
  return found == object.end() ? none : *found;
}

double read_number(const std::string& key, const TuneJson& value, double low, double high) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!std::isfinite(number) || number < low || number > high) {
    std::ostringstream range;
    range << "has to be a number from " << low << " to " << high;
    throw InputError(key, range.str());
  }
  return number;
}

double number_at(const TuneJson& object, const char* key, double low, double high, double other) {
  const TuneJson& value = value_at(object, key);
  return value.is_null() ? other : read_number(key, value, low, high);
}

bool flag_at(const TuneJson& object, const char* key) {
  const TuneJson& value = value_at(object, key);
  if (!value.is_null() && !value.is_boolean()) throw InputError(key, "has to be true or false");
  return value.is_boolean() && value.get<bool>();
}

/// Whether the value of a key is the second of two words; the first is the default.
bool second_at(const TuneJson& object, const char* key, const char* first, const char* second) {
  const TuneJson& value = value_at(object, key);
  if (value.is_null() || value == first) return false;
  if (value != second) {
    throw InputError(key, std::string("has to be ") + first + " or " + second);
  }
  return true;
}

/// A matrix as its diagonal or as its rows, k x k.
Eigen::MatrixXd read_gain_matrix(const std::string& key, const TuneJson& value, Eigen::Index k) {
  if (value.is_array() && !value.empty() && value.front().is_array()) {
    if (static_cast<Eigen::Index>(value.size()) != k) {
      throw InputError(key, "has to have " + std::to_string(k) + " rows");
    }
    Eigen::MatrixXd matrix(k, k);
    for (Eigen::Index i = 0; i < k; ++i) {
      matrix.row(i) = read_numbers(key, value[static_cast<std::size_t>(i)], k).transpose();
    }
    return matrix;
  }
  return Eigen::MatrixXd(read_numbers(key, value, k).asDiagonal());
}

/// {"factor": F} of sqrt(stiffness), {"ratio": Z}, or a matrix. Returns the ratio, or 0.
double read_damping(const std::string& key, const TuneJson& value, const Eigen::MatrixXd& K,
                    Eigen::MatrixXd& damping) {
  damping.setZero(K.rows(), K.cols());
  if (!value.is_object()) {
    if (!value.is_null()) damping = read_gain_matrix(key, value, K.rows());
    return 0;
  }
  check_keys(key, value, {"factor", "ratio"});
  if (value.contains("ratio")) {
    return read_number(key + ".ratio", value["ratio"], 1e-6, controller::kLargestDampingRatio);
  }
  const double factor = read_number(key + ".factor", value_at(value, "factor"), 0, 1e6);
  damping = (factor * K.cwiseMax(0).cwiseSqrt()).eval();  // entry by entry, as an audit has it
  return 0;
}

TuneJson matrix_json(const Eigen::MatrixXd& matrix) {
  const Eigen::MatrixXd diagonal = matrix.diagonal().asDiagonal();
  return matrix == diagonal ? json_list(matrix.diagonal()) : json_rows(matrix);
}

TuneJson damping_json(double ratio, const Eigen::MatrixXd& damping) {
  if (ratio > 0) return {{"ratio", ratio}};
  return matrix_json(damping);
}

/// Gains and loop as the controller would have them.
controller::Settings settings_of(const TunedArm& arm, const controller::AuditOptions& stated) {
  controller::Settings settings = arm.settings();
  if (stated.period > 0) settings.period = stated.period;
  settings.watchdog.longest_gap = std::max(settings.watchdog.longest_gap, 2.5 * settings.period);
  settings.motion.smoothing =
      std::min(settings.motion.smoothing, controller::kMostSmoothing * settings.period);
  settings.analysis.sampled.delay = stated.delay;
  settings.analysis.sampled.cutoff = stated.cutoff;
  settings.analysis.sampled.difference_velocity = stated.difference_velocity;
  settings.integral.time = stated.integral_time;
  settings.feed_forward.gravity = !stated.ideal_gravity;
  settings.limits.gain_margin = stated.margin;
  settings.initial.mode = stated.mode;
  controller::Gains gains = stated.gains;
  if (stated.half_quaternion) gains.task_stiffness.bottomRightCorner<3, 3>() *= 0.5;
  if (stated.mode == Mode::kCartesian) {  // those of the other mode are not looked at
    gains.joint_stiffness = arm.settings().initial.gains.joint_stiffness;
    gains.joint_damping = arm.settings().initial.gains.joint_damping;
    gains.joint_damping_ratio = arm.settings().initial.gains.joint_damping_ratio;
  }
  settings.initial.gains = gains;
  return settings;
}

}  // namespace

TuneJson robot_keys(const controller::RobotDescription& robot) {
  const controller::ModelOptions plain, &options = robot.options;
  TuneJson keys = TuneJson::object();
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
    for (TuneJson& one : keys["gear_stiffness"]) {
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

JointVector read_numbers(const std::string& key, const TuneJson& list, Eigen::Index n) {
  if (!list.is_array() || static_cast<Eigen::Index>(list.size()) != n) {
    throw InputError(key, "has to be a list of " + std::to_string(n) + " numbers");
  }
  JointVector values(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    values[i] = read_number(key, list[static_cast<std::size_t>(i)], -1e9, 1e9);
  }
  return values;
}

TunedArm::TunedArm(const controller::RobotDescription& robot, const controller::Settings* settings)
    : TunedArm(robot, text_of(robot.urdf), settings) {}

TunedArm::TunedArm(controller::RobotDescription robot, std::string urdf,
                   const controller::Settings* settings)
    : robot_(std::move(robot)),
      urdf_(std::move(urdf)),
      model_(controller::RobotModel::from_urdf_text(urdf_, robot_.base, robot_.tip, robot_.options,
                                                    robot_.urdf)),
      settings_(settings != nullptr ? *settings : controller::default_settings(model_)),
      own_settings_(settings != nullptr) {}

TunedArm TunedArm::with(const TuneJson& parts) const {
  check_keys("arm", parts,
             {"payload", "reflected_inertia", "viscous_friction", "gear_stiffness", "gear_damping",
              "position_sensor"});
  controller::RobotDescription robot = robot_;
  controller::ModelOptions& options = robot.options;
  const int n = model_.dof();
  if (const TuneJson& payload = value_at(parts, "payload"); !payload.is_null()) {
    check_keys("payload", payload, {"mass", "center", "inertia"});
    options.payload = {};
    options.payload.mass = number_at(payload, "mass", 0, 1e3, 0);
    if (payload.contains("center")) {
      options.payload.center = read_numbers("payload.center", payload["center"], 3);
    }
    if (payload.contains("inertia")) {
      options.payload.inertia = read_gain_matrix("payload.inertia", payload["inertia"], 3);
    }
  }
  const auto take = [&](const char* key, JointVector& values) {
    const TuneJson& list = value_at(parts, key);
    if (list.is_null()) return;
    values = read_numbers(key, list, n);
    if (values.minCoeff() < 0) throw InputError(key, "a number is negative");
  };
  take("reflected_inertia", options.reflected_inertia);
  take("viscous_friction", options.viscous_friction);
  take("gear_damping", options.gear_damping);
  if (const TuneJson& list = value_at(parts, "gear_stiffness"); !list.is_null()) {
    TuneJson numbers = list;
    if (numbers.is_array()) {
      for (TuneJson& one : numbers) one = one.is_null() ? TuneJson(0.0) : one;
    }
    options.gear_stiffness = read_numbers("gear_stiffness", numbers, n);
    for (double& one : options.gear_stiffness) {
      if (one < 0) throw InputError("gear_stiffness", "a number is negative");
      if (one == 0) one = std::numeric_limits<double>::infinity();
    }
  }
  if (!value_at(parts, "position_sensor").is_null()) {
    options.position_sensor = second_at(parts, "position_sensor", "motor", "link")
                                  ? controller::PositionSensor::kLink
                                  : controller::PositionSensor::kMotor;
  }
  return {robot, urdf_, own_settings_ ? &settings_ : nullptr};
}

bool TunedDesign::designed() const {
  const controller::Gains& gains = stated.gains;
  if (stated.mode == Mode::kJoint) return gains.joint_damping_ratio > 0;
  return gains.task_damping_ratio > 0 || gains.null_damping_ratio > 0;
}

TunedDesign read_design(const TunedArm& arm, const TuneJson& design) {
  check_keys("design", design,
             {"mode", "frame", "stiffness", "damping", "joint_stiffness", "joint_damping",
              "null_stiffness", "null_damping", "null_projector", "rotation", "inertia_blocks",
              "period", "delay", "cutoff", "difference_velocity", "integral_time", "ideal_gravity",
              "gain_margin", "arm"});
  TunedDesign result;
  controller::AuditOptions& stated = result.stated;
  controller::Gains& gains = stated.gains;
  const int n = arm.model().dof();
  stated.mode = second_at(design, "mode", "cartesian", "joint") ? Mode::kJoint : Mode::kCartesian;
  if (second_at(design, "frame", "base", "tool")) gains.frame = controller::Frame::kTool;
  stated.half_quaternion = second_at(design, "rotation", "vector", "half-quaternion");
  stated.kinematic_null_space = second_at(design, "null_projector", "dynamic", "kinematic");
  stated.inertia_blocks = flag_at(design, "inertia_blocks");
  Eigen::MatrixXd damping;
  if (const TuneJson& K = value_at(design, "stiffness"); !K.is_null()) {
    gains.task_stiffness = read_gain_matrix("stiffness", K, 6);
  }
  gains.task_damping_ratio =
      read_damping("damping", value_at(design, "damping"), gains.task_stiffness, damping);
  gains.task_damping = damping;
  gains.joint_stiffness.setZero(n, n);
  if (const TuneJson& K = value_at(design, "joint_stiffness"); !K.is_null()) {
    gains.joint_stiffness = read_gain_matrix("joint_stiffness", K, n);
  }
  gains.joint_damping_ratio = read_damping("joint_damping", value_at(design, "joint_damping"),
                                           gains.joint_stiffness, damping);
  gains.joint_damping = damping;
  gains.null_stiffness.setZero(n);
  if (const TuneJson& K = value_at(design, "null_stiffness"); !K.is_null()) {
    gains.null_stiffness = read_numbers("null_stiffness", K, n);
  }
  gains.null_damping_ratio = read_damping("null_damping", value_at(design, "null_damping"),
                                          gains.null_stiffness.asDiagonal(), damping);
  gains.null_damping = damping.diagonal();
  stated.period = number_at(design, "period", 0, 1, arm.settings().period);
  const double delay = number_at(design, "delay", 0, kMostDelay, 0);
  stated.delay = static_cast<int>(delay);
  if (stated.delay != delay) throw InputError("delay", "must be whole ticks");
  stated.cutoff = number_at(design, "cutoff", 0, 1e6, 0);
  stated.difference_velocity = flag_at(design, "difference_velocity");
  stated.integral_time = number_at(design, "integral_time", 0, 1e6, 0);
  stated.ideal_gravity = flag_at(design, "ideal_gravity");
  stated.margin = number_at(design, "gain_margin", 1, 1e6, arm.settings().limits.gain_margin);
  if (result.designed() && (stated.kinematic_null_space || stated.inertia_blocks)) {
    throw InputError("damping",
                     "is designed for a ratio by Dashpot's controller alone, which has neither a "
                     "kinematic projector nor gains times the tip's inertia");
  }
  result.settings = settings_of(arm, stated);
  return result;
}

TuneJson design_json(const TunedArm& arm) {
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
          {"period", settings.period},
          {"delay", sampled.delay},
          {"cutoff", sampled.cutoff},
          {"difference_velocity", sampled.difference_velocity},
          {"integral_time", settings.integral.time},
          {"ideal_gravity", !settings.feed_forward.gravity},
          {"gain_margin", settings.limits.gain_margin},
          {"arm", TuneJson::object()}};
}

}  // namespace dashpot::apps
