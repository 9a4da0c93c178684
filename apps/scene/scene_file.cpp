#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/apps/scene/scene_parts.hpp>
#include <dashpot/controller/config.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace dashpot::apps {

using controller::Joint;
using text::kAnyNumber;
using text::kNotNegative;
using text::kPositive;
using text::Units;
using text::YamlMapping;
using text::YamlNode;

namespace {

/// Reads a time into `microseconds`.
void read_microseconds(const YamlMapping& keys, const char* key, std::int64_t& microseconds) {
  constexpr double kLongestTime = 3600;  // s
  double seconds = 1e-6 * static_cast<double>(microseconds);
  read_number(keys, key, "s", kPositive, seconds);
  if (seconds > kLongestTime) throw keys.error(key, "is more than an hour");
  microseconds = std::llround(1e6 * seconds);
}

/// Reads a limit that can only be lowered.
void read_at_most(const YamlMapping& keys, const char* key, const char* unit, double& limit) {
  const text::Range range{0, false, limit};
  read_number(keys, key, unit, range, limit);
}

}  // namespace

void read_commands(const YamlMapping& root, lcmtypes::CommandLimits& limits) {
  static constexpr auto kKeys =
      text::key_list("reach", "force", "torque", "joint_stiffness", "joint_damping",
                     "task_stiffness", "task_damping", "damping_ratio", "payload",
                     "payload_distance", "tool_distance", "linear_velocity", "angular_velocity",
                     "tip_velocity", "oldest", "furthest", "silence", "most_per_second", "burst");
  const YamlMapping keys = root.mapping("commands", kKeys);
  read_number(keys, "reach", "m", kPositive, limits.reach);
  read_number(keys, "force", "N", kNotNegative, limits.force);
  read_number(keys, "torque", "N m", kNotNegative, limits.torque);
  read_number(keys, "joint_stiffness", "N m/rad", kNotNegative, limits.joint_stiffness);
  read_number(keys, "joint_damping", "N m s/rad", kNotNegative, limits.joint_damping);
  read_number(keys, "task_stiffness", "N/m", kNotNegative, limits.task_stiffness);
  read_number(keys, "task_damping", "N s/m", kNotNegative, limits.task_damping);
  read_at_most(keys, "damping_ratio", "", limits.damping_ratio);
  read_number(keys, "payload", "kg", kNotNegative, limits.payload);
  read_number(keys, "payload_distance", "m", kNotNegative, limits.payload_distance);
  read_number(keys, "tool_distance", "m", kNotNegative, limits.tool_distance);
  read_at_most(keys, "linear_velocity", "m/s", limits.linear_velocity);
  read_at_most(keys, "angular_velocity", "rad/s", limits.angular_velocity);
  read_at_most(keys, "tip_velocity", "m/s", limits.tip_velocity);
  read_microseconds(keys, "oldest", limits.oldest);
  read_microseconds(keys, "furthest", limits.furthest);
  read_microseconds(keys, "silence", limits.silence);
  read_number(keys, "most_per_second", "", kPositive, limits.most_per_second);
  int burst = static_cast<int>(limits.burst);
  read_count(keys, "burst", 1, burst);
  limits.burst = burst;
}

namespace {

/// Reads the errors of the sensors. Returns whether there are any.
bool read_sensor_fault(const YamlMapping& keys, const Units& positions, sim::SensorFault& fault) {
  const auto n = static_cast<Eigen::Index>(positions.size());
  if (keys.has("position_offset")) {
    fault.position_offset = JointVector::Zero(n);
    read_numbers(keys, "position_offset", positions, kAnyNumber, fault.position_offset);
  }
  if (keys.has("velocity_factor")) {
    fault.velocity_factor = JointVector::Ones(n);
    read_numbers(keys, "velocity_factor", Units(positions.size()), kAnyNumber,
                 fault.velocity_factor);
  }
  read_switch(keys, "frozen", fault.frozen);
  read_switch(keys, "not_a_number", fault.not_a_number);
  double clock_offset = 0;
  read_number(keys, "clock_offset", "s", kAnyNumber, clock_offset);
  if (std::abs(clock_offset) > 1e6) throw keys.error("clock_offset", "is more than 1e6 s");
  fault.clock_offset = std::llround(1e9 * clock_offset);
  return fault.position_offset.size() > 0 || fault.velocity_factor.size() > 0 || fault.frozen ||
         fault.not_a_number || fault.clock_offset != 0;
}

/// Reads when the controller is not called. Returns whether there is such a time.
bool read_loop_fault(const YamlMapping& keys, const Units& positions, LoopFault& fault) {
  bool pause = false;
  read_switch(keys, "pause", pause);
  read_count(keys, "call_every", 1, fault.every);
  if (pause && keys.has("call_every")) {
    throw keys.error("call_every", "stands beside pause, in which there are no calls");
  }
  if (keys.has("moved_by")) {
    if (!pause || !keys.has("end")) {
      throw keys.error("moved_by", "goes with a pause that has an end");
    }
    fault.moved_by = JointVector::Zero(static_cast<Eigen::Index>(positions.size()));
    read_numbers(keys, "moved_by", positions, kAnyNumber, fault.moved_by);
  }
  if (pause) fault.every = 0;
  return fault.every != 1;
}

}  // namespace

void read_faults(const YamlMapping& scenario, const Units& positions, Scene& scene) {
  static constexpr auto kKeys =
      text::key_list("begin", "end", "position_offset", "velocity_factor", "frozen", "not_a_number",
                     "clock_offset", "call_every", "pause", "moved_by");
  for (const YamlMapping& keys : mappings(scenario, "faults", kKeys)) {
    require(keys, "begin", scenario, "faults");
    sim::SensorFault sensors;
    read_when(keys, scene, sensors.begin, sensors.end);
    LoopFault loop{sensors.begin, sensors.end, 1, {}};
    const bool wrong_sensors = read_sensor_fault(keys, positions, sensors);
    const bool wrong_loop = read_loop_fault(keys, positions, loop);
    if (!wrong_sensors && !wrong_loop) throw keys.error("begin", "is of a fault that does nothing");
    if (wrong_sensors) scene.plant.faults.push_back(sensors);
    if (wrong_loop) scene.loop_faults.push_back(loop);
  }
}

namespace {

lcmtypes::CommandLimits command_limits(const YamlMapping& root, const controller::Config& config) {
  lcmtypes::CommandLimits limits;
  limits.position_lower = config.settings.limits.position_lower;
  limits.position_upper = config.settings.limits.position_upper;
  limits.linear_velocity = config.settings.motion.linear_velocity;
  limits.angular_velocity = config.settings.motion.angular_velocity;
  limits.tip_velocity = config.settings.limits.tip_velocity;
  read_commands(root, limits);
  return limits;
}

void read_arm(const YamlNode& document, const std::filesystem::path& directory, Scene& scene) {
  const YamlMapping root(document, "", controller::kConfigSections);
  if (!root.has("scenario")) {
    throw InputError("scenario",
                     "missing: this is a configuration of the controller, for dashpot_create; a "
                     "scene also has a start, such as scenario: {start: {position: [0, "
                     "...]}} (sim/scenes/panda.yaml has all keys)");
  }
  controller::Config config = controller::read_config(document, directory);
  const controller::RobotDescription robot = config.robot;
  const Units positions = controller::joint_units(config.model, "rad", "m");
  ArmSimulation simulation{believed(config.robot, config.model), {}, directory};
  if (config.model.position_sensor() == controller::PositionSensor::kLink) {
    simulation.options.position_sensor = sim::PositionSensor::kLink;
  }
  scene.plant.period = config.settings.period;
  scene.commands = command_limits(root, config);
  read_simulation(root, positions, scene.plant, simulation);
  try {
    scene.arm.emplace(ControlledArm{
        std::move(config),
        sim::Robot::from_file(robot.urdf, robot.base, robot.tip, simulation.parameters),
        simulation.options});
  } catch (const sim::InvalidRobot& error) {
    throw InputError("simulation", error.what());
  }
  read_scenario(root, positions, scene);
}

/// Throws if fixed steps are too long for elastic gears: the integrator would damp them, and a
/// ringing arm would look calm.
void check_steps(const Scene& scene) {
  constexpr double kFinest = 0.5;  // omega h, at which RK4 damps with a ratio of 2e-4
  const sim::IntegratorOptions& integrator = scene.plant.integrator;
  if (integrator.adaptive) return;
  const double omega = sim::Arm(scene.arm->robot).fastest_gear(scene.start);
  const double step = std::min(integrator.max_step, scene.plant.period);
  if (omega * step <= kFinest) return;
  throw InputError("simulation.integrator.step",
                   "is " + format_number(step, 3) + " s, too long for gears of " +
                       format_number(omega, 3) + " rad/s: at most " +
                       format_number(kFinest / omega, 2) +
                       " s is possible, or adaptive steps, the default of such arms");
}

/// Throws unless the simulator accepts the scene.
void check(const Scene& scene) try {
  check_steps(scene);
  sim::Arm arm(scene.arm->robot, scene.arm->options);
  const sim::Plant plant(arm, scene.plant, scene.start, scene.velocity);
} catch (const sim::InvalidScene& error) {
  throw InputError("simulation", error.what());
}

}  // namespace

sim::RobotParameters believed(const controller::RobotDescription& robot,
                              const controller::RobotModel& model) {
  const controller::ModelOptions& options = robot.options;
  sim::RobotParameters parameters;
  parameters.reflected_inertia = model.joint_values(&Joint::reflected_inertia);
  parameters.viscous_friction = model.joint_values(&Joint::viscous_friction);
  parameters.coulomb_friction = model.joint_values(&Joint::coulomb_friction);
  parameters.gear_stiffness = model.joint_values(&Joint::gear_stiffness);
  parameters.gear_damping = model.joint_values(&Joint::gear_damping);
  parameters.gravity = options.gravity;
  parameters.accept_inertias = true;  // the controller's model has judged them
  parameters.payload = {options.payload.mass, options.payload.center, options.payload.inertia};
  return parameters;
}

Scene load_scene(const std::string& path) try {
  Scene scene;
  scene.path = path;
  const YamlNode document = text::parse_yaml(text::read_regular_file(path));
  if (has_key(document, "mass")) {
    throw InputError("", "is a system of matrices, which dashpot analyze and design take");
  }
  read_arm(document, std::filesystem::path(path).parent_path(), scene);
  check(scene);
  return scene;
} catch (const InputError& error) {
  throw error.in_file(path);
}

CommandedConfig load_commanded_config(const std::string& path) try {
  const YamlNode document = text::parse_yaml(text::read_regular_file(path));
  controller::Config config =
      controller::read_config(document, std::filesystem::path(path).parent_path());
  const lcmtypes::CommandLimits limits =
      command_limits(YamlMapping(document, "", controller::kConfigSections), config);
  return {std::move(config), limits};
} catch (const InputError& error) {
  throw error.in_file(path);
}

JointVector posture_of(const std::string& config, const PostureOption& option,
                       const controller::RobotModel& model) {
  const bool starts =
      option.q.empty() && has_key(text::parse_yaml(text::read_regular_file(config)), "scenario");
  return option.read(model, starts ? load_scene(config).start : JointVector());
}

}  // namespace dashpot::apps
