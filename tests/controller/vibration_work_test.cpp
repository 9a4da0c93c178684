// Modes from within the tick: what is computed, what is left out, and what is forgotten.
#include <dashpot/controller/vibration/vibration.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/hostile_ticks.hpp>
#include <dashpot/tests/support/led_arm.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace dashpot::controller {
namespace {

using analysis::SpectrumOrigin;
using testing::at;
using testing::in_mode;
using testing::kSmallSwing;
using testing::LedArm;
using testing::panda_model;
using testing::unlimited_settings;

TEST(VibrationInTheTick, ComputesNothingWhileNothingChanges) {
  const RobotModel model = panda_model();
  LedArm led(model, in_mode(unlimited_settings(model), Mode::kCartesian), kSmallSwing);
  led.settle();
  const Vibration before = led.modes();
  for (int k = 0; k < 100; ++k) led.tick();
  const Vibration& after = led.modes();
  EXPECT_EQ(after.counters.unchanged, before.counters.unchanged + 100);
  EXPECT_EQ(after.counters.tracked, before.counters.tracked);
  EXPECT_EQ(after.counters.direct, before.counters.direct);
  EXPECT_EQ(after.origin, SpectrumOrigin::kReused);
  EXPECT_EQ(after.tick, before.tick + 100);
  EXPECT_EQ(after.time, led.state.time);
  for (int i = 0; i < after.count; ++i) {
    EXPECT_EQ(after.modes[at(i)].eigenvalues, before.modes[at(i)].eigenvalues);
  }
  // The smallest motion that there is matters.
  led.state.position[3] = std::nextafter(led.state.position[3], 0.0);
  led.tick();
  EXPECT_EQ(led.modes().counters.unchanged, after.counters.unchanged);
  EXPECT_EQ(led.modes().origin, SpectrumOrigin::kTracked);
}

// A robot that is damped at the same spot before and after a reset: nothing changed, and yet there
// is nothing to repeat.
TEST(VibrationInTheTick, RepeatsNothingFromBeforeAReset) {
  const RobotModel model = panda_model();
  Settings settings = in_mode(unlimited_settings(model), Mode::kJoint);
  settings.limits.position_upper[3] = -2.5;  // the robot stands outside
  settings.limits.return_velocity.setZero();
  LedArm led(model, settings, kSmallSwing);
  for (int k = 0; k < 5; ++k) ASSERT_EQ(led.tick(), Status::kPositionLimit);
  EXPECT_EQ(led.modes().counters.no_springs, 1U);
  EXPECT_EQ(led.modes().counters.unchanged, 4U);
  led.controller.reset();
  ASSERT_EQ(led.tick(), Status::kPositionLimit);
  EXPECT_EQ(led.modes().counters.no_springs, 1U);
  EXPECT_EQ(led.modes().counters.unchanged, 0U);
}

/// One that was to be solved directly may be missed; the next one then is.
TEST(VibrationSolver, SolvesAnewAfterATaskThatItMissed) {
  VibrationSolver solver(Analysis{});
  Vibration result;
  VibrationTask task;
  task.position.setZero(2);
  task.system = analysis::System<kMaxJoints>(2);
  task.system.stiffness.diagonal() << 100, 400;
  const auto solved = [&](std::uint64_t number, std::uint64_t restarts) {
    task.number = number;
    task.restarts = restarts;
    task.system.mass(0, 0) += 1e-4;
    solver.solve(task, result);
    return result.origin;
  };
  EXPECT_EQ(solved(1, 0), SpectrumOrigin::kDirect);
  EXPECT_EQ(solved(2, 0), SpectrumOrigin::kTracked);
  EXPECT_EQ(solved(4, 1), SpectrumOrigin::kDirect);
  EXPECT_EQ(solved(5, 1), SpectrumOrigin::kTracked);
  EXPECT_EQ(result.counters.missed, 1);
}

/// A change of gains is no standing still.
TEST(VibrationInTheTick, SeesGainsChange) {
  const RobotModel model = panda_model();
  LedArm led(model, in_mode(unlimited_settings(model), Mode::kJoint), kSmallSwing);
  led.settle();
  led.tick();
  const Vibration before = led.modes();
  led.setpoint.gains.joint_stiffness *= 4;
  led.settle();
  const Vibration& after = led.modes();
  ASSERT_EQ(after.count, 7);
  double ratio = 1;
  for (std::size_t i = 0; i < 7; ++i) {
    ratio *= after.modes[i].natural_frequency / before.modes[i].natural_frequency;
  }
  EXPECT_NEAR(ratio, 128, 1e-6);
  std::set<int> labels, old;
  for (std::size_t i = 0; i < 7; ++i) {
    labels.insert(after.modes[i].label);
    old.insert(before.modes[i].label);
  }
  EXPECT_EQ(labels, old);
}

TEST(VibrationInTheTick, IsNotThereIfOff) {
  const RobotModel model = panda_model();
  Settings settings = unlimited_settings(model);
  settings.analysis.where = Analysis::Where::kOff;
  LedArm led(model, in_mode(settings, Mode::kCartesian), kSmallSwing);
  led.settle();
  EXPECT_EQ(led.modes().tick, 0u);
  EXPECT_EQ(led.modes().count, 0);
  const VibrationCounters& counters = led.modes().counters;
  EXPECT_EQ(counters.tracked + counters.reused + counters.direct + counters.unchanged +
                counters.no_springs + counters.failed + counters.missed,
            0u);
}

TEST(VibrationInTheTick, LeavesOutShapesThatNobodyWants) {
  const RobotModel model = panda_model();
  Settings settings = unlimited_settings(model);
  settings.analysis.shapes = false;
  LedArm led(model, in_mode(settings, Mode::kCartesian), kSmallSwing);
  settings.analysis.shapes = true;
  LedArm full(model, in_mode(settings, Mode::kCartesian), kSmallSwing);
  for (int k = 0; k < 600; ++k) {
    led.swing(1e-3 * k);
    full.swing(1e-3 * k);
    led.tick();
    full.tick();
  }
  ASSERT_EQ(led.modes().count, 7);
  EXPECT_GE(led.modes().counters.no_shapes, led.modes().counters.tracked);
  EXPECT_EQ(full.modes().counters.no_shapes, 0u);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(led.modes().modes[i].shape.size(), 0);
    EXPECT_EQ(full.modes().modes[i].shape.size(), 7);
    EXPECT_EQ(led.modes().modes[i].eigenvalues, full.modes().modes[i].eigenvalues);
  }
}

TEST(VibrationInTheTick, HasNothingToSolveWithoutSprings) {
  const RobotModel model = panda_model();
  Settings settings = unlimited_settings(model);
  settings.watchdog.setpoint_damp = 0.01;
  LedArm led(model, in_mode(settings, Mode::kJoint), kSmallSwing);
  led.settle();
  const std::uint64_t solved = led.modes().counters.tracked + led.modes().counters.direct;
  for (int k = 1; k <= 50; ++k) {
    led.swing(1e-3 * k);
    led.state.time += 1'000'000;
    led.controller.update(led.state, led.setpoint, led.torque);
  }
  EXPECT_EQ(led.controller.snapshot().status, Status::kSetpointLost);
  EXPECT_EQ(led.modes().tick, led.controller.snapshot().tick);
  EXPECT_EQ(led.modes().status, analysis::Status::kOk);
  EXPECT_EQ(led.modes().count, 0);
  EXPECT_EQ(led.modes().zero_modes, 7);
  EXPECT_GE(led.modes().counters.no_springs, 35u);
  EXPECT_LE(led.modes().counters.tracked + led.modes().counters.direct, solved + 15);
}

TEST(VibrationInTheTick, TellsZeroModesFromVibrations) {
  const RobotModel model = panda_model();
  Settings settings = unlimited_settings(model);
  settings.initial.gains.null_stiffness.setZero();
  LedArm free(model, in_mode(settings, Mode::kCartesian), kSmallSwing);
  free.settle();
  for (int k = 1; k <= 100; ++k) {
    free.swing(1e-3 * k);
    free.tick();
  }
  EXPECT_EQ(free.modes().count, 6);
  EXPECT_EQ(free.modes().zero_modes, 1);
  EXPECT_EQ(free.modes().counters.no_zero_modes, 0u);
  EXPECT_GE(free.modes().counters.tracked, 100u);
  LedArm held(model, in_mode(unlimited_settings(model), Mode::kCartesian), kSmallSwing);
  held.settle();
  EXPECT_EQ(held.modes().zero_modes, 0);
  EXPECT_EQ(
      held.modes().counters.no_zero_modes,
      held.modes().counters.tracked + held.modes().counters.direct + held.modes().counters.reused);
}

TEST(VibrationInTheTick, LeavesOutTermsThatAreZero) {
  const RobotModel model = panda_model();
  Settings settings = unlimited_settings(model);
  settings.task_terms = {Load::kBaseWrench, true};
  LedArm led(model, in_mode(settings, Mode::kCartesian), kSmallSwing);
  led.settle();
  const auto swing = [&](int from) {
    for (int k = from + 1; k <= from + 100; ++k) {
      led.swing(1e-3 * k);
      led.state.velocity.setZero();
      led.tick();
    }
    return led.modes().counters;
  };
  const VibrationCounters before = led.modes().counters;
  const VibrationCounters still = swing(0);
  EXPECT_EQ(still.no_wrench, before.no_wrench + 100);
  EXPECT_EQ(still.at_rest, before.at_rest + 100);
  EXPECT_EQ(still.tracked, before.tracked + 100);
  led.state.external_wrench << 20, 0, -10, 0, 1, 0;
  const VibrationCounters loaded = swing(100);
  EXPECT_EQ(loaded.no_wrench, still.no_wrench);
  EXPECT_EQ(loaded.at_rest, still.at_rest + 100);
  // A nonsymmetric stiffness is followed as well, from its first tick on.
  EXPECT_EQ(loaded.direct, still.direct + 1);
  EXPECT_EQ(loaded.tracked, still.tracked + 99);
}

/// Whatever the analysis makes of hostile input, the torque is what it is without.
TEST(VibrationInTheTick, NeverTouchesTheTorque) {
  const RobotModel model = panda_model();
  Settings settings = testing::HostileTicks::everything_on(model);
  settings.analysis.every = 1;
  settings.task_terms = {Load::kToolWrench, false};
  Controller with(model, settings);
  settings.analysis.where = Analysis::Where::kOff;
  Controller without(model, settings);
  testing::HostileTicks input(model, settings, 611, 0.02);
  JointVector torque, plain;
  for (int k = 0; k < 20'000; ++k) {
    input.next();
    ASSERT_EQ(with.update(input.state, input.setpoint, torque),
              without.update(input.state, input.setpoint, plain));
    ASSERT_EQ(torque, plain);
    const Vibration& modes = with.vibration();
    ASSERT_TRUE(modes.count > 0 || modes.zero_modes == 7 || modes.status != analysis::Status::kOk ||
                modes.tick == 0);
  }
  const VibrationCounters& counters = with.vibration().counters;
  EXPECT_GT(counters.tracked, 0u);
  EXPECT_GT(counters.direct, 0u);
}

TEST(VibrationInTheTick, ForgetsAtAReset) {
  const RobotModel model = panda_model();
  LedArm first(model, in_mode(unlimited_settings(model), Mode::kCartesian), kSmallSwing);
  LedArm again(model, in_mode(unlimited_settings(model), Mode::kCartesian), kSmallSwing);
  const auto run = [](LedArm& led) {
    for (int k = 0; k < 600; ++k) {
      led.swing(1e-3 * k);
      led.tick();
    }
  };
  again.setpoint.mode = Mode::kJoint;  // its modes are not those of the Cartesian mode
  run(again);
  again.setpoint.mode = Mode::kCartesian;
  again.controller.reset();
  EXPECT_EQ(again.modes().tick, 0u);
  EXPECT_EQ(again.modes().count, 0);
  EXPECT_EQ(again.modes().counters.tracked, 0u);
  run(again);
  run(first);
  ASSERT_EQ(again.modes().count, 7);
  EXPECT_EQ(again.modes().counters.tracked, first.modes().counters.tracked);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(again.modes().modes[i].label, first.modes().modes[i].label);
    EXPECT_EQ(again.modes().modes[i].eigenvalues, first.modes().modes[i].eigenvalues);
  }
}

}  // namespace
}  // namespace dashpot::controller
