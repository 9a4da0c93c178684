// Integral action and friction compensation at the measured velocity, on simulated arms: the
// remaining steady error, the motion of a held arm after its release, and the energy.
#include <dashpot/tests/support/released_arm.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace dashpot {
namespace {

using controller::FeedForward;
using controller::JointVector;
using controller::Mode;
using testing::TwinModels;

constexpr double kTime = 0.5;  // of the integral, s
constexpr double kShare = 0.8;

/// A Panda whose joints have Coulomb friction that its controller knows, and which carries a mass
/// at its tip, in kg, that its controller does not know.
struct RoughPanda {
  explicit RoughPanda(double coulomb, double untold = 0) {
    const testing::Arm& arm = testing::arms()[0];
    controller::ModelOptions options;
    sim::RobotParameters parameters;
    options.reflected_inertia = parameters.reflected_inertia = JointVector::Constant(7, 0.1);
    options.coulomb_friction = parameters.coulomb_friction = JointVector::Constant(7, coulomb);
    parameters.payload.mass = untold;
    twin.model = arm_model(arm, options);
    twin.robot = sim::Robot::from_file(testing::arm_path(arm.file), arm.base, arm.tip, parameters);
    q0 << 0, -0.785, 0.1, -2.2, 0.2, 1.7, 0.785;
    settings = default_settings(twin.model);
    settings.analysis.where = controller::Analysis::Where::kOff;
    settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
    settings.motion.gain_time = 0.05;
    controller::Gains& gains = settings.initial.gains;
    gains.joint_damping_ratio = gains.task_damping_ratio = gains.null_damping_ratio = 0;
    gains.joint_stiffness = JointVector::Constant(7, 60).asDiagonal();
    gains.joint_damping = JointVector::Constant(7, 20).asDiagonal();
  }
  /// Springs at the tip, isotropic: N/m, N m/rad and their dampers.
  void hold_tip(double stiffness, double damping, double turning, double turning_damping) {
    settings.initial.mode = Mode::kCartesian;
    controller::Gains& gains = settings.initial.gains;
    gains.task_stiffness.diagonal() << Eigen::Vector3d::Constant(stiffness),
        Eigen::Vector3d::Constant(turning);
    gains.task_damping.diagonal() << Eigen::Vector3d::Constant(damping),
        Eigen::Vector3d::Constant(turning_damping);
    gains.null_stiffness.setConstant(10);
    gains.null_damping.setConstant(5);
  }
  void compensate_friction() {
    settings.feed_forward.friction = true;
    settings.feed_forward.friction_at = FeedForward::FrictionAt::kMeasured;
    settings.feed_forward.friction_share = kShare;
    settings.feed_forward.friction_rise = 0.05;
  }

  TwinModels twin{testing::arms()[0]};
  JointVector q0 = JointVector::Zero(7);
  controller::Settings settings;
};

/// Controller and plant in one loop.
struct Loop {
  Loop(const RoughPanda& panda, sim::PlantOptions options = {}, double friction_velocity = 1e-3)
      : controller(panda.twin.model, panda.settings),
        setpoint(panda.settings.initial),
        arm(panda.twin.robot, arm_options(friction_velocity)),
        plant(arm, with_steps(options, panda), panda.q0) {
    const auto there = evaluate(panda.twin.model, panda.q0, JointVector::Zero(7));
    setpoint.joint_position = panda.q0;
    setpoint.tip_pose = {there.p_BT_B, there.R_BT};
    controller.reset(there.gravity);
  }
  static sim::ArmOptions arm_options(double friction_velocity) {
    sim::ArmOptions options;
    options.friction_velocity = friction_velocity;
    return options;
  }
  static sim::PlantOptions with_steps(sim::PlantOptions options, const RoughPanda& panda) {
    options.integrator.max_step = 1e-4;
    options.initial_torque = evaluate(panda.twin.model, panda.q0, JointVector::Zero(7)).gravity;
    return options;
  }
  controller::Status tick() {
    state.time += 1'000'000;
    state.position = plant.measured().position;
    state.velocity = plant.measured().velocity;
    setpoint.time = state.time;
    return controller.update(state, setpoint, torque);
  }
  void run(double seconds) {
    for (int k = 0; k < std::lround(seconds * 1000); ++k) {
      worst = worse(worst, tick());
      ASSERT_EQ(plant.step(torque), sim::Status::kOk);
    }
  }

  controller::Controller controller;
  controller::RobotState state;
  controller::Setpoint setpoint;
  controller::Status worst = controller::Status::kOk;
  JointVector torque;
  sim::Arm arm;
  sim::Plant plant;
};

/// Returns the remaining error of joint 1, rad, once the arm rests at 0.4 rad.
double miss(const RoughPanda& panda) {
  Loop loop(panda);
  loop.run(0.2);
  loop.setpoint.joint_position[0] += 0.4;
  loop.run(3.5);
  EXPECT_EQ(loop.worst, controller::Status::kOk) << to_text(loop.worst);
  return panda.q0[0] + 0.4 - loop.plant.position()[0];
}

TEST(SteadyError, IsSmallerWithEachOfTheTwo) {
  RoughPanda plain(1), friction(1), integral(1);
  friction.compensate_friction();
  integral.settings.integral.time = kTime;
  const double without = miss(plain);
  const double compensated = miss(friction);
  const double integrated = miss(integral);
  // Springs of 60 N m/rad stop at 1 N m. The remaining friction stops them at 0.2 N m; from where
  // its compensation fades, the reference brakes.
  const double fading = 0.05 * 0.05 / (2 * 0.5 * plain.settings.motion.acceleration[0]);
  std::printf(
      "1 N m on 60 N m/rad: misses by %.2e rad; with friction compensated %.2e, integral %.2e\n",
      without, compensated, integrated);
  EXPECT_GT(without, 0.5 / 60);
  EXPECT_LT(without, 1.0 / 60);
  EXPECT_LT(std::abs(compensated), (1 - kShare) / 60 + 2 * fading);
  EXPECT_LT(std::abs(integrated), 0.3 * without);
}

/// The weight of a payload that the model lacks lowers the tip by m g / k, and with the integral,
/// which takes the weight over, it comes back.
TEST(SteadyError, OfAnUntoldPayloadGoesToZero) {
  DASHPOT_SKIP_IF_QUICK();
  constexpr double kMass = 0.5, kStiffness = 400, kSlow = 1;
  RoughPanda plain(0, kMass), integral(0, kMass);
  for (RoughPanda* panda : {&plain, &integral}) panda->hold_tip(kStiffness, 50, 30, 4);
  integral.settings.integral = {kSlow, 20, 5, integral.settings.integral.torque};
  const auto sag = [](Loop& loop) { return loop.controller.snapshot().tip_error[2]; };
  Loop without(plain), with(integral);
  without.run(3);
  const double expected = kMass * 9.81 / kStiffness;
  EXPECT_NEAR(sag(without), expected, 0.01 * expected);
  with.run(3);
  const double early = sag(with);
  with.run(4);
  std::printf(
      "0.5 kg untold: sags by %.2e m; with the integral %.2e m after 3 s, %.2e m after 7 s\n",
      sag(without), early, sag(with));
  EXPECT_LT(std::abs(sag(with)), 2e-3 * expected);
  EXPECT_NEAR(with.controller.snapshot().integral_wrench[2], kMass * 9.81, 2e-3 * kMass * 9.81);
  EXPECT_EQ(with.worst, controller::Status::kOk) << to_text(with.worst);
}

/// A hand holds the arm away from its goal until the integral is at its bound, and lets go.
TEST(HeldArm, IsNotThrownWhenLetGo) {
  RoughPanda panda(0);
  panda.settings.integral = {kTime, 10, 1, JointVector::Constant(7, 3)};
  Loop loop(panda);
  loop.run(0.2);
  JointVector held = panda.q0;
  held[0] -= 0.05;  // its spring pulls with 3 N m
  const JointVector none = JointVector::Zero(7);
  for (int k = 0; k < 3000; ++k) {
    loop.worst = worse(loop.worst, loop.tick());
    const double s = std::min(1.0, k / 500.0), course = s * s * (3 - 2 * s);
    loop.plant.carry(panda.q0 + course * (held - panda.q0),
                     s < 1 ? JointVector(12 * s * (1 - s) * (held - panda.q0)) : none);
  }
  EXPECT_EQ(loop.controller.snapshot().integral_torque[0], 3);
  double farthest = 0, fastest = 0;
  for (int k = 0; k < 4000; ++k) {
    loop.worst = worse(loop.worst, loop.tick());
    ASSERT_LE(loop.controller.snapshot().integral_torque.cwiseAbs().maxCoeff(), 3);
    ASSERT_EQ(loop.plant.step(loop.torque), sim::Status::kOk);
    farthest = std::max(farthest, loop.plant.position()[0] - panda.q0[0]);
    fastest = std::max(fastest, std::abs(loop.plant.velocity()[0]));
  }
  std::printf(
      "let go at -0.05 rad with 3 N m stored: swings to %.3f rad with %.2f rad/s, rests at %.1e\n",
      farthest, fastest, loop.plant.position()[0] - panda.q0[0]);
  EXPECT_LT(farthest, 3.0 / 60);  // deflection of the spring by the bound
  EXPECT_GT(farthest, 0.1 * 3.0 / 60);
  EXPECT_LT((loop.plant.position() - panda.q0).cwiseAbs().maxCoeff(), 5e-4);
  EXPECT_LT(std::abs(loop.controller.snapshot().integral_torque[0]), 0.01);
  EXPECT_EQ(loop.worst, controller::Status::kOk) << to_text(loop.worst);
}

/// The torque that compensates friction is the difference of two controllers.
TEST(FrictionCompensation, GivesLessThanFrictionTakes) {
  DASHPOT_SKIP_IF_QUICK();
  struct Sensors {
    const char* name;
    double velocity_noise, resolution;
    bool difference;
  };
  for (const Sensors& sensors : {Sensors{"exact", 0, 0, false}, Sensors{"noise", 0.05, 0, false},
                                 Sensors{"differenced", 0, 2e-5, true}}) {
    SCOPED_TRACE(sensors.name);
    RoughPanda with(1), without(1);
    with.compensate_friction();
    sim::PlantOptions options;
    if (sensors.velocity_noise > 0) {
      options.velocity_noise = JointVector::Constant(7, sensors.velocity_noise);
    }
    if (sensors.resolution > 0) {
      options.position_resolution = JointVector::Constant(7, sensors.resolution);
    }
    options.difference_velocity = sensors.difference;
    options.seed = 5;
    Loop loop(with, options), other(without);
    double given = 0, rest_given = 0, rest_taken = 0;
    for (int k = 0; k < 3000; ++k) {
      if (k == 200) loop.setpoint.joint_position[0] += 0.3;
      loop.tick();
      other.state = loop.state;
      other.setpoint = loop.setpoint;
      other.controller.update(other.state, other.setpoint, other.torque);
      const JointVector before = loop.plant.position();
      const sim::EnergyAudit then = loop.plant.audit();
      ASSERT_EQ(loop.plant.step(loop.torque), sim::Status::kOk);
      const double work =
          (loop.torque - other.torque).dot(JointVector(loop.plant.position() - before));
      const sim::EnergyAudit now = loop.plant.audit();
      given += work;
      if (k < 2500) continue;
      rest_given += work;
      rest_taken += now.dissipated() - then.dissipated();
    }
    const double taken = loop.plant.audit().dissipated();
    std::printf("%s: gives %.4f of %.4f J that friction takes; at rest %.1e of %.1e J\n",
                sensors.name, given, taken, rest_given, rest_taken);
    EXPECT_GT(given, 0.1 * taken);
    EXPECT_LT(given, kShare * taken);
    // Torque that only follows noise gives a joint at rest (torque period)^2 / (2 inertia) a tick.
    const double shaken = sensors.velocity_noise > 0 ? 500 * 7 * kShare * kShare * 1e-6 / 0.2 : 0;
    EXPECT_LE(rest_given, kShare * rest_taken + shaken + 1e-12);
    EXPECT_LT(loop.plant.velocity().norm(), 0.01);
  }
}

}  // namespace
}  // namespace dashpot
