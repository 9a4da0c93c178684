#pragma once
// Parts that a simulation leaves out if a scene lacks them, beside the same scene with such parts,
// but without effect.

#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/skip_tally.hpp>
#include <dashpot/tests/support/tracker_paths.hpp>

#include <functional>
#include <limits>

namespace dashpot::testing {

/// All that a scene of an arm has.
struct PlantScene {
  sim::RobotParameters parameters;
  sim::ArmOptions arm;
  sim::PlantOptions plant;
};

struct PlantSkip {
  SkipTally tally;
  std::function<void(PlantScene&)> with;  ///< adds it, without effect
  double allowed = 0;                     ///< rad and rad/s; 0: the same bits
};

/// Rounding errors of a hundred periods; and of those by a method that differentiates numerically,
/// which leaves half the digits.
inline constexpr double kSameMotion = 1e-11, kSameByRosenbrock = 1e-8;
/// A digit or two of what is measured.
inline constexpr double kSameSensors = 1e-15;

inline std::vector<PlantSkip> plant_skips() {
  using sim::Contact;
  std::vector<PlantSkip> all;
  const auto add = [&](const char* what, double allowed, std::function<void(PlantScene&)> with) {
    all.push_back({{what}, std::move(with), allowed});
  };
  add("no viscous friction", kSameMotion,
      [](PlantScene& s) { s.parameters.viscous_friction.setConstant(7, 1e-18); });
  add("no Coulomb friction", kSameMotion,
      [](PlantScene& s) { s.parameters.coulomb_friction.setConstant(7, 1e-18); });
  add("no stops", 0, [](PlantScene& s) { s.arm.stops = Contact{2000, 20}; });
  add("no wall", 0, [](PlantScene& s) {
    s.arm.wall = sim::Wall{};
    s.arm.wall->point.z() = -10;
  });
  add("no wrench", kSameMotion, [](PlantScene& s) {
    s.arm.wrenches = {{0, 1e9, 1e-18 * sim::Vector6::Ones()}};
  });
  add("no torque limit", 0, [](PlantScene& s) {
    s.plant.torque_limit.setConstant(7, std::numeric_limits<double>::infinity());
  });
  add("no low-pass", kSameMotion, [](PlantScene& s) { s.plant.torque_cutoff = 1e9; });
  add("no noise", kSameSensors, [](PlantScene& s) {
    s.plant.position_noise.setConstant(7, 1e-18);
    s.plant.velocity_noise.setConstant(7, 1e-18);
  });
  add("no counts", kSameSensors,
      [](PlantScene& s) { s.plant.position_resolution.setConstant(7, 0x1p-52); });
  return all;
}

/// Moves a Panda with and without it for a tenth of a second, by every method, and compares what
/// the sensors show.
inline void run_skip(std::uint64_t seed, PlantSkip& skip) {
  constexpr int kTicks = 100;  // within the joints' limits
  Dice dice(seed);
  sim::JointVector q(7), torque(7);
  q << 0, -0.785, 0, -2.0, 0, 1.571, 0.785;
  for (double& angle : q) angle += dice.uniform(-0.3, 0.3);
  using sim::Method;
  for (const Method method :
       {Method::kSemiImplicitEuler, Method::kRungeKutta4, Method::kDormandPrince,
        Method::kDormandPrince8, Method::kImplicitMidpoint, Method::kRosenbrock}) {
    PlantScene lean;
    lean.parameters.viscous_friction = lean.parameters.coulomb_friction = sim::JointVector::Zero(7);
    lean.plant.integrator.method = method;
    PlantScene full = lean;
    skip.with(full);
    const double allowed = method == Method::kRosenbrock && skip.allowed == kSameMotion
                               ? kSameByRosenbrock
                               : skip.allowed;
    const auto make = [](const PlantScene& scene) {
      return sim::Arm(sim::Robot::from_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf",
                                            "panda_link0", "panda_hand_tcp", scene.parameters),
                      scene.arm);
    };
    sim::Arm lean_arm = make(lean), full_arm = make(full);
    sim::Plant without(lean_arm, lean.plant, q), with(full_arm, full.plant, q);
    for (int k = 0; k < kTicks; ++k) {
      for (Eigen::Index i = 0; i < 7; ++i) {
        torque[i] = (i < 4 ? 10 : 0.1) * std::sin(0.01 * k + static_cast<double>(i));
      }
      const sim::Status a = without.step(torque), b = with.step(torque);
      if (a != b) skip.tally.fail();
      ++skip.tally.left_out;
      for (Eigen::Index i = 0; i < 7; ++i) {
        skip.tally.see(with.measured().position[i], without.measured().position[i], allowed);
        skip.tally.see(with.measured().velocity[i], without.measured().velocity[i], allowed);
      }
    }
  }
}

/// A Panda that falls onto a wall below its tip, moved by adaptive steps. Steps of order 5 begin
/// with the last rates of the step before, unless a contact changed; steps of order 8 evaluate them
/// again.
inline void run_contact_skip(std::uint64_t seed, SkipTally& tally) {
  constexpr int kTicks = 300;
  constexpr double kAllowed = 1e-7;  // rad and rad/s, of a tolerance of 1e-10 a step
  Dice dice(seed);
  sim::JointVector q(7);
  q << 0, -0.5, 0, -2.0, 0, 1.571, 0.785;
  for (double& angle : q) angle += dice.uniform(-0.2, 0.2);
  PlantScene scene;
  scene.parameters.viscous_friction.setConstant(7, 1.0);
  const sim::Robot robot = sim::Robot::from_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf",
                                                 "panda_link0", "panda_hand_tcp", scene.parameters);
  scene.arm.wall = sim::Wall{};
  scene.arm.wall->point.z() = sim::Arm(robot).tip_pose(q).position.z() - 0.05;
  scene.plant.integrator.adaptive = true;
  scene.plant.integrator.absolute_tolerance = 1e-10;
  scene.plant.integrator.relative_tolerance = 0;
  scene.plant.period = 0.002;  // several steps
  scene.plant.integrator.max_step = scene.plant.period;
  sim::Arm first(robot, scene.arm), second(robot, scene.arm);
  scene.plant.integrator.method = sim::Method::kDormandPrince;
  sim::Plant keeping(first, scene.plant, q);
  scene.plant.integrator.method = sim::Method::kDormandPrince8;
  sim::Plant evaluating(second, scene.plant, q);
  const sim::JointVector torque = sim::JointVector::Zero(7);
  for (int k = 0; k < kTicks; ++k) {
    if (keeping.step(torque) != sim::Status::kOk || evaluating.step(torque) != sim::Status::kOk) {
      return tally.fail();
    }
    for (Eigen::Index i = 0; i < 7; ++i) {
      tally.see(keeping.position()[i], evaluating.position()[i], kAllowed);
      tally.see(keeping.velocity()[i], evaluating.velocity()[i], kAllowed);
    }
  }
  if (keeping.audit().contact_heat > 0) ++tally.left_out;  // it did touch
}

}  // namespace dashpot::testing
