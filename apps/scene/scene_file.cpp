#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/report/text_table.hpp>
#include <dashpot/apps/scene/scene_file.hpp>
#include <dashpot/apps/scene/scene_parts.hpp>
#include <dashpot/controller/config.hpp>

#include <algorithm>
#include <filesystem>

namespace dashpot::apps {
namespace {

using controller::Joint;
using text::kPositive;
using text::Units;
using text::YamlMapping;
using text::YamlNode;

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
