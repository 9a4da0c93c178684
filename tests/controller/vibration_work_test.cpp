// Modes from within the tick: which steps are computed, skipped and forgotten.
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
using testing::LedArm;
using testing::panda_model;

/// A Panda that swings a little, or not at all.
struct SmallSwing : LedArm {
  explicit SmallSwing(Mode mode, void (*change)(Settings&) = nullptr)
      : LedArm(panda_model(), settings_with(mode, change), testing::kSmallSwing) {}
  static Settings settings_with(Mode mode, void (*change)(Settings&)) {
    Settings settings = testing::in_mode(testing::unlimited_settings(panda_model()), mode);
    if (change != nullptr) change(settings);
    return settings;
  }
  void swing_from(int first, int last, bool at_rest = false) {
    for (int k = first; k <= last; ++k) {
      swing(1e-3 * k);
      if (at_rest) state.velocity.setZero();
      tick();
    }
  }
  const VibrationCounters& counters() const { return modes().counters; }
};

void expect_same_eigenvalues(const Vibration& a, const Vibration& b) {
  ASSERT_EQ(a.count, b.count);
  for (int i = 0; i < a.count; ++i) {
    EXPECT_EQ(a.modes[at(i)].eigenvalues, b.modes[at(i)].eigenvalues);
    EXPECT_EQ(a.modes[at(i)].label, b.modes[at(i)].label);
  }
}

TEST(VibrationInTheTick, ComputesNothingWhileNothingChanges) {
  SmallSwing led(Mode::kCartesian);
  led.settle();
  const Vibration before = led.modes();
  for (int k = 0; k < 100; ++k) led.tick();
  const Vibration after = led.modes();
  EXPECT_EQ(after.counters.unchanged, before.counters.unchanged + 100);
  EXPECT_EQ(after.counters.tracked, before.counters.tracked);
  EXPECT_EQ(after.counters.direct, before.counters.direct);
  EXPECT_EQ(after.origin, SpectrumOrigin::kReused);
  EXPECT_EQ(after.tick, before.tick + 100);
  EXPECT_EQ(after.time, led.state.time);
  expect_same_eigenvalues(after, before);
  // The smallest representable motion matters.
  led.state.position[3] = std::nextafter(led.state.position[3], 0.0);
  led.tick();
  EXPECT_EQ(led.counters().unchanged, after.counters.unchanged);
  EXPECT_EQ(led.modes().origin, SpectrumOrigin::kTracked);
}

// A robot that is damped at the same posture before and after a reset: nothing changed, but there
// is nothing to repeat.
TEST(VibrationInTheTick, RepeatsNothingFromBeforeAReset) {
  SmallSwing led(Mode::kJoint, [](Settings& settings) {
    settings.limits.position_upper[3] = -2.5;  // the robot stands outside
  });
  for (int k = 0; k < 5; ++k) ASSERT_EQ(led.tick(), Status::kPositionLimit);
  EXPECT_EQ(led.counters().no_springs, 1U);
  EXPECT_EQ(led.counters().unchanged, 4U);
  led.controller.reset();
  ASSERT_EQ(led.tick(), Status::kPositionLimit);
  EXPECT_EQ(led.counters().no_springs, 1U);
  EXPECT_EQ(led.counters().unchanged, 0U);
}

/// A task that was to be solved directly may be missed; the next one then is.
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

/// A change of gains does not count as standing still.
TEST(VibrationInTheTick, SeesGainsChange) {
  SmallSwing led(Mode::kJoint);
  led.settle();
  led.tick();
  const Vibration before = led.modes();
  led.setpoint.gains.joint_stiffness *= 4;
  led.settle();
  const Vibration& after = led.modes();
  ASSERT_EQ(after.count, 7);
  double ratio = 1;
  std::set<int> labels, old;
  for (int i = 0; i < 7; ++i) {
    ratio *= after.modes[at(i)].natural_frequency / before.modes[at(i)].natural_frequency;
    labels.insert(after.modes[at(i)].label);
    old.insert(before.modes[at(i)].label);
  }
  EXPECT_NEAR(ratio, 128, 1e-6);
  EXPECT_EQ(labels, old);
}

TEST(VibrationInTheTick, IsNotThereIfOff) {
  SmallSwing led(Mode::kCartesian,
                 [](Settings& settings) { settings.analysis.where = Analysis::Where::kOff; });
  led.settle();
  EXPECT_EQ(led.modes().tick, 0u);
  EXPECT_EQ(led.modes().count, 0);
  const VibrationCounters& seen = led.counters();
  EXPECT_EQ(seen.tracked + seen.reused + seen.direct + seen.unchanged + seen.no_springs +
                seen.failed + seen.missed,
            0u);
}

TEST(VibrationInTheTick, LeavesOutShapesThatNobodyWants) {
  SmallSwing led(Mode::kCartesian, [](Settings& settings) { settings.analysis.shapes = false; });
  SmallSwing full(Mode::kCartesian, [](Settings& settings) { settings.analysis.shapes = true; });
  for (SmallSwing* one : {&led, &full}) one->swing_from(0, 600);
  ASSERT_EQ(led.modes().count, 7);
  EXPECT_GE(led.counters().no_shapes, led.counters().tracked);
  EXPECT_EQ(full.counters().no_shapes, 0u);
  expect_same_eigenvalues(led.modes(), full.modes());
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(led.modes().modes[at(i)].shape.size(), 0);
    EXPECT_EQ(full.modes().modes[at(i)].shape.size(), 7);
  }
}

TEST(VibrationInTheTick, HasNothingToSolveWithoutSprings) {
  SmallSwing led(Mode::kJoint, [](Settings& settings) { settings.watchdog.setpoint_damp = 0.01; });
  led.settle();
  const std::uint64_t solved = led.counters().tracked + led.counters().direct;
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
  EXPECT_GE(led.counters().no_springs, 35u);
  EXPECT_LE(led.counters().tracked + led.counters().direct, solved + 15);
}

TEST(VibrationInTheTick, TellsZeroModesFromVibrations) {
  SmallSwing free(Mode::kCartesian,
                  [](Settings& settings) { settings.initial.gains.null_stiffness.setZero(); });
  free.settle();
  free.swing_from(1, 100);
  EXPECT_EQ(free.modes().count, 6);
  EXPECT_EQ(free.modes().zero_modes, 1);
  EXPECT_EQ(free.counters().no_zero_modes, 0u);
  EXPECT_GE(free.counters().tracked, 100u);
  SmallSwing held(Mode::kCartesian);
  held.settle();
  EXPECT_EQ(held.modes().zero_modes, 0);
  const VibrationCounters& seen = held.counters();
  EXPECT_EQ(seen.no_zero_modes, seen.tracked + seen.direct + seen.reused);
}

TEST(VibrationInTheTick, LeavesOutTermsThatAreZero) {
  SmallSwing led(Mode::kCartesian, [](Settings& settings) {
    settings.task_terms = {Load::kBaseWrench, true};
  });
  led.settle();
  const VibrationCounters before = led.counters();
  led.swing_from(1, 100, true);
  const VibrationCounters still = led.counters();
  EXPECT_EQ(still.no_wrench, before.no_wrench + 100);
  EXPECT_EQ(still.at_rest, before.at_rest + 100);
  EXPECT_EQ(still.tracked, before.tracked + 100);
  led.state.external_wrench << 20, 0, -10, 0, 1, 0;
  led.swing_from(101, 200, true);
  const VibrationCounters loaded = led.counters();
  EXPECT_EQ(loaded.no_wrench, still.no_wrench);
  EXPECT_EQ(loaded.at_rest, still.at_rest + 100);
  // A nonsymmetric stiffness is followed as well, from its first tick on.
  EXPECT_EQ(loaded.direct, still.direct + 1);
  EXPECT_EQ(loaded.tracked, still.tracked + 99);
}

/// Whether and how often hostile input is analysed does not change the torque.
TEST(VibrationInTheTick, NeverTouchesTheTorque) {
  const RobotModel model = panda_model();
  Settings settings = testing::HostileTicks::everything_on(model);
  settings.analysis.every = 1;
  settings.task_terms = {Load::kToolWrench, false};
  Controller with(model, settings);
  Settings others[] = {settings, settings, settings};
  others[0].analysis.where = Analysis::Where::kOff;
  others[1].analysis.every = 7;
  others[2].analysis.shapes = false;
  Controller off(model, others[0]), rare(model, others[1]), plainer(model, others[2]);
  testing::HostileTicks input(model, settings, 611, 0.02);
  JointVector torque, plain;
  for (int k = 0; k < 10'000; ++k) {
    input.next();
    const Status status = with.update(input.state, input.setpoint, torque);
    for (Controller* other : {&off, &rare, &plainer}) {
      ASSERT_EQ(other->update(input.state, input.setpoint, plain), status);
      ASSERT_EQ(torque, plain);
    }
    const Vibration& modes = with.vibration();
    ASSERT_TRUE(modes.count > 0 || modes.zero_modes == 7 || modes.status != analysis::Status::kOk ||
                modes.tick == 0);
  }
  const VibrationCounters& counters = with.vibration().counters;
  EXPECT_GT(counters.tracked, 0u);
  EXPECT_GT(counters.direct, 0u);
}

TEST(VibrationInTheTick, ForgetsAtAReset) {
  SmallSwing first(Mode::kCartesian), again(Mode::kCartesian);
  again.setpoint.mode = Mode::kJoint;  // its modes differ from the Cartesian mode's
  again.swing_from(0, 600);
  again.setpoint.mode = Mode::kCartesian;
  again.controller.reset();
  EXPECT_EQ(again.modes().tick, 0u);
  EXPECT_EQ(again.modes().count, 0);
  EXPECT_EQ(again.counters().tracked, 0u);
  for (SmallSwing* one : {&first, &again}) one->swing_from(0, 600);
  ASSERT_EQ(again.modes().count, 7);
  EXPECT_EQ(again.counters().tracked, first.counters().tracked);
  expect_same_eigenvalues(again.modes(), first.modes());
}

}  // namespace
}  // namespace dashpot::controller
