#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/run/sampled_modes.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <cmath>

namespace dashpot::apps {
namespace {

/// The springs and dampers at rest, as the controller has them once they have set in.
analysis::System<> loop_at_rest(const Scene& scene) {
  controller::Settings settings = scene.arm->config.settings;
  settings.motion.gain_time = settings.period;
  settings.analysis.where = controller::Analysis::Where::kOff;
  controller::Controller controller(scene.arm->config.model, settings);
  controller::RobotState state;
  state.position = scene.rest;
  state.velocity = JointVector::Zero(scene.dof());
  controller::Setpoint setpoint = scene.steps.front().setpoint;
  JointVector torque;
  for (int i = 0; i < 10; ++i) {
    state.time = setpoint.time = i * std::llround(1e9 * settings.period);
    controller.update(state, setpoint, torque);
  }
  analysis::System<controller::kMaxJoints> system;
  controller.closed_loop(system);
  analysis::System<> result(system.dof());
  result.mass = system.mass;
  result.damping = system.damping;
  result.stiffness = system.stiffness;
  result.stiffness_factor = system.stiffness_factor;
  return result;
}

}  // namespace

SampledModes sampled_modes(const Scene& scene) {
  const controller::RobotModel& model = scene.arm->config.model;
  analysis::SampledLoop loop;
  loop.period = scene.plant.period;
  loop.delay = scene.plant.delay;
  loop.torque_cutoff = scene.plant.torque_cutoff;
  loop.difference_velocity = scene.plant.difference_velocity;
  const controller::Settings& settings = scene.arm->config.settings;
  const auto robot = controller::evaluate(model, scene.rest, JointVector::Zero(scene.dof()));
  const controller::PassivePart outside = controller::passive_part(
      robot.J, settings.environment, controller::JointMatrix::Zero(scene.dof(), scene.dof()));
  loop.friction = outside.damping;
  loop.friction.diagonal() += model.joint_values(&controller::Joint::viscous_friction);
  loop.passive_stiffness = outside.stiffness;
  if (settings.feed_forward.gravity) {
    loop.gravity_gradient =
        controller::gravity_gradient(controller::DynamicsKernel(model), scene.rest);
  }
  loop.memory = controller::integral_memory(
      robot, controller::Impedance(scene.steps.front().setpoint, scene.dof()),
      settings.integral.time, loop.period);
  loop.gears = controller::elastic_joints(model);
  loop = analysis::with_gears(loop);
  const analysis::System<> system = loop_at_rest(scene);
  SampledModes result;
  result.continuous = analysis::analyze(system);
  result.sampled = analysis::sample_loop(system, result.continuous, loop);
  result.gain_margin = analysis::gain_margin(system, result.continuous, loop);
  return result;
}

}  // namespace dashpot::apps
