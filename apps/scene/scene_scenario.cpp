#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/apps/scene/scene_parts.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/settings.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dashpot::apps {

using controller::Pose;
using controller::RobotModel;
using controller::Vector6;
using text::kAnyNumber;
using text::kNotNegative;
using text::kPositive;
using text::Units;
using text::YamlMapping;
using text::YamlNode;

namespace {

/// The goal of the tip in the directions `selected` (1 or 0 each) in the axes R.
struct TipGoal {
  Pose pose;
  Vector6 selected = Vector6::Ones();
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();

  /// Returns the distance of `tip` from the goal in the selected directions: m, and a rotation
  /// vector in rad; base axes.
  Vector6 miss(const controller::DynamicsResult& tip) const {
    Vector6 error;
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(pose.rotation * tip.R_BT.transpose()));
    error << pose.position - tip.p_BT_B, turn.angle() * turn.axis();
    return controller::part_along(selected, R, error);
  }
};

/// The goal's miss at the nearest position within the position limits that a descent from `q`
/// finds: Levenberg and Marquardt's, with joints that would leave their limits held there.
Vector6 descend(const RobotModel& model, const controller::Limits& limits, const TipGoal& goal,
                JointVector q) {
  constexpr int kSteps = 100;
  constexpr double kExact = 1e-9;
  const Eigen::Index n = q.size();
  const JointVector still = JointVector::Zero(n);
  controller::DynamicsResult robot = controller::evaluate(model, q, still);
  Vector6 miss = goal.miss(robot);
  double damping = 1e-3;
  for (int step = 0; step < kSteps && miss.norm() > kExact && damping < 1e6; ++step) {
    Eigen::MatrixXd J(6, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      J.col(j) = controller::part_along(goal.selected, goal.R, robot.J.col(j));
    }
    const Eigen::VectorXd downhill = J.transpose() * miss;
    for (Eigen::Index j = 0; j < n; ++j) {
      const bool out =
          downhill[j] > 0 ? q[j] >= limits.position_upper[j] : q[j] <= limits.position_lower[j];
      if (out) J.col(j).setZero();
    }
    const Eigen::MatrixXd A = J * J.transpose() + damping * Eigen::MatrixXd::Identity(6, 6);
    const JointVector next = (q + J.transpose() * A.llt().solve(miss))
                                 .cwiseMax(limits.position_lower)
                                 .cwiseMin(limits.position_upper);
    const controller::DynamicsResult there = controller::evaluate(model, next, still);
    const Vector6 left = goal.miss(there);
    if (left.norm() < miss.norm()) {
      q = next;
      robot = there;
      miss = left;
      damping = std::max(1e-9, 0.1 * damping);
    } else {
      damping *= 10;
    }
  }
  return miss;
}

/// The distance from the goal at the nearest position found within the limits, from `q` and from
/// postures all over the range: zero, to 1e-6 m and rad, if the arm reaches the goal.
Vector6 out_of_reach_by(const RobotModel& model, const controller::Limits& limits,
                        const TipGoal& goal, const JointVector& q) {
  constexpr int kPostures = 32;
  constexpr double kThere = 1e-6;
  Vector6 least = descend(model, limits, goal, q);
  const controller::PostureSequence postures(limits.position_lower, limits.position_upper);
  for (int k = 0; k < kPostures && least.norm() > kThere; ++k) {
    const Vector6 miss = descend(model, limits, goal, postures.at(k));
    if (miss.norm() < least.norm()) least = miss;
  }
  return least.norm() > kThere ? least : Vector6(Vector6::Zero());
}

constexpr double kLongest = 1e7;  // s
const Units kTaskUnits = {"m", "m", "m", "rad", "rad", "rad"};
const Units kWrenchUnits = {"N", "N", "N", "N m", "N m", "N m"};

Pose tip_at(const RobotModel& model, const JointVector& q) {
  const auto there = controller::evaluate(model, q, JointVector::Zero(q.size()));
  return {there.p_BT_B, there.R_BT};
}

Pose moved(const Pose& pose, const Vector6& displacement) {
  const Eigen::Vector3d turn = displacement.tail<3>();
  return {pose.position + displacement.head<3>(),
          Eigen::AngleAxisd(turn.norm(), turn.normalized()) * pose.rotation};
}

/// Throws unless q, given under `key`, is within the position limits.
void check_limits(const YamlMapping& keys, std::string_view key, const JointVector& q,
                  const Units& positions, const Scene& scene) {
  const controller::Limits& limits = scene.arm->config.settings.limits;
  for (int i = 0; i < scene.dof(); ++i) {
    if (q[i] >= limits.position_lower[i] && q[i] <= limits.position_upper[i]) continue;
    const std::string said = controller::outside_limits(scene.arm->config.model, q);
    if (!said.empty()) throw keys.error(key, said);
    throw keys.error(key, "joint " + std::to_string(i + 1) + " would be at " +
                              std::to_string(q[i]) + " " + positions[static_cast<std::size_t>(i)] +
                              ", outside its limits");
  }
}

/// Throws if a joint would start faster than its limit.
void check_speeds(const YamlMapping& keys, const Units& velocities, const Scene& scene) {
  const JointVector& most = scene.arm->config.settings.limits.velocity;
  for (int i = 0; i < scene.dof(); ++i) {
    if (std::abs(scene.velocity[i]) <= most[i]) continue;
    const std::string& unit = velocities[static_cast<std::size_t>(i)];
    std::string said = "joint " + std::to_string(i + 1) + " would start with ";
    said.append(format_number(scene.velocity[i], 3)).append(" ").append(unit);
    said.append(", its limit is ").append(format_number(most[i], 3)).append(" ").append(unit);
    throw keys.error("velocity", said + ": 'outside_limits: true' lets it");
  }
}

/// Throws if the arm would start inside the wall.
void check_wall(const YamlMapping& keys, std::string_view key, const Scene& scene) {
  const auto& wall = scene.arm->options.wall;
  if (!wall) return;
  const Eigen::Vector3d tip = sim::Arm(scene.arm->robot).tip_pose(scene.start).position;
  const double depth = wall->normal.normalized().dot(wall->point - tip);
  if (depth > 0) {
    throw keys.error(key, "puts the tip " + format_number(depth, 3) + " m inside the wall");
  }
}

std::string out_of_reach(const Vector6& by) {
  return "is out of the arm's reach, by " + format_number(by.head<3>().norm(), 3) + " m and " +
         format_number(by.tail<3>().norm(), 3) + " rad";
}

/// Throws unless the tip can reach a Cartesian set-point.
void check_reach(const YamlMapping& keys, const controller::Setpoint& setpoint,
                 const Scene& scene) {
  if (setpoint.mode != controller::Mode::kCartesian) return;
  TipGoal goal{setpoint.tip_pose};
  for (int i = 0; i < 6; ++i) {
    goal.selected[i] = setpoint.gains.directions[static_cast<std::size_t>(i)] ? 1 : 0;
  }
  if (setpoint.gains.frame == controller::Frame::kTool) goal.R = setpoint.tip_pose.rotation;
  const controller::Config& config = scene.arm->config;
  const Vector6 by = out_of_reach_by(config.model, config.settings.limits, goal, scene.rest);
  const char* key = keys.has("tip_displacement") ? "tip_displacement" : "mode";
  if (!by.isZero(0)) throw keys.error(key, out_of_reach(by));
}

void read_start(const YamlMapping& scenario, const Units& positions, Scene& scene) {
  static constexpr auto kKeys = text::key_list("position", "velocity", "joint_displacement",
                                               "tip_displacement", "outside_limits");
  const YamlMapping keys = scenario.mapping("start", kKeys);
  read_switch(keys, "outside_limits", scene.outside_limits);
  require(keys, "position", scenario, "start");
  read_numbers(keys, "position", positions, kAnyNumber, scene.rest);
  const Units velocities = controller::joint_units(scene.arm->config.model, "rad/s", "m/s");
  read_numbers(keys, "velocity", velocities, kAnyNumber, scene.velocity);
  if (!scene.outside_limits) check_speeds(keys, velocities, scene);
  scene.start = scene.rest;
  if (keys.has("joint_displacement") && keys.has("tip_displacement")) {
    throw keys.error("tip_displacement", "stands beside joint_displacement; one of them is enough");
  }
  if (keys.has("joint_displacement")) {
    JointVector displacement = scene.rest;
    read_numbers(keys, "joint_displacement", positions, kAnyNumber, displacement);
    scene.start += displacement;
  }
  if (keys.has("tip_displacement")) {
    Eigen::VectorXd displacement = Eigen::VectorXd::Zero(6);
    read_numbers(keys, "tip_displacement", kTaskUnits, kAnyNumber, displacement);
    if (displacement.tail(3).norm() > std::numbers::pi) {
      throw keys.error("tip_displacement",
                       "turns by more than half a turn, in rad; degrees are "
                       "written as '5 deg'");
    }
    const auto q = displaced(scene.arm->config.model, scene.rest, displacement);
    if (!q) {
      const TipGoal goal{moved(tip_at(scene.arm->config.model, scene.rest), displacement)};
      throw keys.error(
          "tip_displacement",
          out_of_reach(out_of_reach_by(scene.arm->config.model, scene.arm->config.settings.limits,
                                       goal, scene.rest)));
    }
    scene.start = *q;
  }
  const char* moved_by = keys.has("tip_displacement")     ? "tip_displacement"
                         : keys.has("joint_displacement") ? "joint_displacement"
                                                          : "position";
  if (scene.outside_limits) {
    const controller::Limits& limits = scene.arm->config.settings.limits;
    scene.rest = scene.start.cwiseMax(limits.position_lower).cwiseMin(limits.position_upper);
  }
  check_limits(keys, "position", scene.rest, positions, scene);
  if (!scene.outside_limits) check_limits(keys, moved_by, scene.start, positions, scene);
  check_wall(keys, moved_by, scene);
}

void read_pushes(const YamlMapping& scenario, Scene& scene) {
  static constexpr auto kKeys = text::key_list("begin", "end", "wrench");
  for (const YamlMapping& keys : mappings(scenario, "pushes", kKeys)) {
    sim::Piece<sim::Vector6> piece;
    for (const char* key : {"begin", "end", "wrench"}) require(keys, key, scenario, "pushes");
    read_when(keys, scene, piece.begin, piece.end);
    read_numbers(keys, "wrench", kWrenchUnits, kAnyNumber, piece.value);
    scene.arm->options.wrenches.push_back(piece);
  }
}

/// Reads bodies that the arm picks up and puts down again, in addition to its payload.
void read_loads(const YamlMapping& scenario, Scene& scene) {
  static constexpr auto kKeys = text::key_list("begin", "end", "mass", "center", "inertia");
  for (const YamlMapping& keys : mappings(scenario, "loads", kKeys)) {
    sim::Piece<sim::Inertia> piece;
    piece.end = std::numeric_limits<double>::infinity();
    require(keys, "begin", scenario, "loads");
    require(keys, "mass", scenario, "loads");
    read_when(keys, scene, piece.begin, piece.end);
    read_body(keys, piece.value.mass, piece.value.center, piece.value.about_center);
    scene.arm->options.loads.push_back(piece);
  }
}

/// Reads scenario.tables: the stiffness and damping of the wall from `begin` to `end`.
void read_tables(const YamlMapping& scenario, Scene& scene) {
  static constexpr auto kKeys = text::key_list("begin", "end", "stiffness", "damping");
  sim::ArmOptions& options = scene.arm->options;
  if (scenario.has("tables") && !options.wall) {
    throw scenario.error("tables", "need simulation.wall, which is their place");
  }
  for (const YamlMapping& keys : mappings(scenario, "tables", kKeys)) {
    sim::Piece<sim::Contact> piece;
    piece.end = std::numeric_limits<double>::infinity();
    for (const char* key : {"begin", "stiffness"}) require(keys, key, scenario, "tables");
    read_when(keys, scene, piece.begin, piece.end);
    read_contact(keys, "N/m", "N s/m", piece.value);
    if (!options.tables.empty() && piece.begin < options.tables.back().end) {
      throw keys.error("begin", "is before the end of the table above it");
    }
    options.tables.push_back(piece);
  }
}

/// The set-point that holds the arm where it starts, with the gains of the file.
controller::Setpoint first_setpoint(const Scene& scene) {
  controller::Setpoint setpoint = scene.arm->config.settings.initial;
  setpoint.joint_position = scene.rest;
  setpoint.tip_pose = tip_at(scene.arm->config.model, scene.rest);
  return setpoint;
}

void read_steps(const YamlMapping& scenario, const Units& positions, Scene& scene) {
  static constexpr auto kKeys = text::key_list("at", "mode", "joint_position", "tip_displacement",
                                               "wrench", "gains", "null_projector", "payload");
  static constexpr auto kPayload = text::key_list("mass", "center", "inertia");
  static constexpr std::array<std::pair<std::string_view, controller::Mode>, 2> kModes = {
      {{"joint", controller::Mode::kJoint}, {"cartesian", controller::Mode::kCartesian}}};
  const RobotModel& model = scene.arm->config.model;
  scene.steps.push_back({0, 0, first_setpoint(scene), {}});
  const Pose origin = scene.steps.front().setpoint.tip_pose;
  for (const YamlMapping& keys : mappings(scenario, "steps", kKeys)) {
    ScenarioStep step = scene.steps.back();
    step.payload.reset();
    require(keys, "at", scenario, "steps");
    read_number(keys, "at", "s", kNotNegative, step.at);
    step.line = keys.line("at");
    if (step.at < scene.steps.back().at) throw keys.error("at", "is before the step above it");
    if (step.at > scene.duration) throw keys.error("at", "is after the end of the scenario");
    controller::Setpoint& setpoint = step.setpoint;
    read_choice(keys, "mode", kModes, setpoint.mode);
    read_numbers(keys, "joint_position", positions, kAnyNumber, setpoint.joint_position);
    if (keys.has("joint_position")) {
      check_limits(keys, "joint_position", setpoint.joint_position, positions, scene);
    }
    if (keys.has("tip_displacement")) {
      Eigen::VectorXd displacement = Eigen::VectorXd::Zero(6);
      read_numbers(keys, "tip_displacement", kTaskUnits, kAnyNumber, displacement);
      setpoint.tip_pose = moved(origin, displacement);
    }
    read_numbers(keys, "wrench", kWrenchUnits, kAnyNumber, setpoint.wrench);
    controller::read_gains(keys, model, controller::GainPairs::kEither, setpoint.gains);
    read_choice(keys, "null_projector", controller::kNullProjectors, setpoint.gains.null_projector);
    if (keys.has("payload")) {
      controller::Payload& payload = step.payload.emplace();
      read_body(keys.mapping("payload", kPayload), payload.mass, payload.center, payload.inertia);
    }
    check_reach(keys, setpoint, scene);
    scene.steps.push_back(step);
  }
}

}  // namespace

std::vector<YamlMapping> mappings(const YamlMapping& keys, std::string_view key,
                                  std::span<const std::string_view> known_keys) {
  const YamlNode* node = keys.find(key);
  std::vector<YamlMapping> result;
  if (node == nullptr) return result;
  if (node->kind != YamlNode::Kind::kSequence) {
    throw keys.error(key, "a list is wanted, not " + text::describe(*node));
  }
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    result.emplace_back(node->items[i],
                        "scenario." + std::string(key) + "[" + std::to_string(i + 1) + "].",
                        known_keys);
  }
  return result;
}

void read_when(const YamlMapping& keys, const Scene& scene, double& begin, double& end) {
  read_number(keys, "begin", "s", kNotNegative, begin);
  read_number(keys, "end", "s", kPositive, end);
  if (end <= begin) throw keys.error("end", "is not after begin");
  if (begin > scene.duration) throw keys.error("begin", "is after the end of the scenario");
}

void require(const YamlMapping& keys, std::string_view key, const YamlMapping& parent,
             std::string_view name) {
  if (!keys.has(key)) throw keys.error(key, "missing", parent.line(name));
}

std::optional<JointVector> displaced(const RobotModel& model, const JointVector& q,
                                     const Vector6& displacement) {
  const Pose goal = moved(tip_at(model, q), displacement);
  JointVector at = q;
  for (int i = 0; i < 50; ++i) {
    const auto there = controller::evaluate(model, at, JointVector::Zero(q.size()));
    Vector6 error;
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(goal.rotation * there.R_BT.transpose()));
    error << goal.position - there.p_BT_B, turn.angle() * turn.axis();
    if (!error.allFinite()) return {};
    if (error.norm() < 1e-12) return at;
    // With M = L L': dq = L^-T (J L^-T)^+ error.
    const Eigen::LLT<Eigen::MatrixXd> M(there.M);
    const Eigen::MatrixXd J_scaled =
        M.matrixL().solve(Eigen::MatrixXd(there.J).transpose()).transpose();
    const Eigen::VectorXd step =
        J_scaled.completeOrthogonalDecomposition().solve(Eigen::VectorXd(error));
    at += M.matrixU().solve(step);
  }
  return {};
}

void read_scenario(const YamlMapping& root, const Units& positions, Scene& scene) {
  static constexpr auto kKeys = text::key_list("duration", "start", "pushes", "loads", "tables",
                                               "steps", "faults", "ring_down");
  const YamlMapping keys = root.mapping("scenario", kKeys);
  read_number(keys, "duration", "s", kPositive, scene.duration);
  if (scene.duration > kLongest) throw keys.error("duration", "is more than 1e7 s");
  read_switch(keys, "ring_down", scene.ring_down);
  scene.rest = scene.velocity = JointVector::Zero(static_cast<Eigen::Index>(positions.size()));
  read_start(keys, positions, scene);
  read_pushes(keys, scene);
  read_loads(keys, scene);
  read_tables(keys, scene);
  read_steps(keys, positions, scene);
  read_faults(keys, positions, scene);
}

}  // namespace dashpot::apps
