// The sampled loop, analysed on a thread: when; its numbers are in one_loop_test.cpp.
#include <dashpot/controller/controller.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace dashpot::controller {
namespace {

using testing::panda_model;

/// A Panda that is held still at one place by Cartesian springs.
struct StillArm : testing::LedArm {
  explicit StillArm(const Analysis::Sampled& sampled)
      : LedArm(testing::panda_model(), settings(sampled)) {
    setpoint.mode = Mode::kCartesian;
  }
  static Settings settings(const Analysis::Sampled& sampled) {
    Settings result = default_settings(testing::panda_model());
    result.motion.gain_time = result.period;  // at once
    result.analysis.sampled = sampled;
    return result;
  }
  /// Ticks until something new has been found about a tick after `tick_number`.
  const SampledVibration* wait_for(std::uint64_t tick_number) {
    using std::chrono::steady_clock;
    const auto end = steady_clock::now() + testing::kHang;
    while (steady_clock::now() < end) {
      tick();
      const SampledVibration* found = controller.sampled_vibration();
      if (found != nullptr && found->tick > tick_number) return found;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return nullptr;
  }
};

TEST(SampledAnalysis, LooksAtTheLoopOnceInAnInterval) {
  StillArm arm({0.05, 0, 0, false});
  std::uint64_t last = 0;
  for (int k = 0; k < 5; ++k) {
    const SampledVibration* found = arm.wait_for(last);
    ASSERT_NE(found, nullptr);
    EXPECT_EQ(found->tick % 50, 2U);
    EXPECT_EQ(found->time, static_cast<std::int64_t>(1'000'000 * found->tick));
    last = found->tick;
  }
}

TEST(SampledAnalysis, BeginsAnewAfterAReset) {
  StillArm arm({10, 0, 0, false});
  ASSERT_NE(arm.wait_for(0), nullptr);
  ASSERT_NE(arm.controller.sampled_vibration(), nullptr);
  arm.controller.reset();
  EXPECT_EQ(arm.controller.sampled_vibration(), nullptr);
  const SampledVibration* found = arm.wait_for(0);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->tick, 2U);
}

TEST(SampledAnalysis, IsThereOnlyIfAskedFor) {
  StillArm arm({});
  for (int k = 0; k < 50; ++k) arm.tick();
  EXPECT_EQ(arm.controller.sampled_vibration(), nullptr);
}

// Modes from a thread of their own: the numbers of those within the tick.

struct SwingingArm : testing::LedArm {
  SwingingArm(const RobotModel& robot, Analysis::Where where)
      : LedArm(robot, settings(robot, where), testing::kSmallSwing) {
    setpoint.mode = Mode::kJoint;
  }
  static Settings settings(const RobotModel& model, Analysis::Where where) {
    Settings settings = default_settings(model);
    settings.analysis.where = where;
    settings.motion.gain_time = settings.period;  // at once
    return settings;
  }
  /// One tick; `moving` or not.
  void tick(bool moving = true) {
    if (moving) time += 1e-3;
    swing(time);
    if (!moving) state.velocity.setZero();
    LedArm::tick();
  }
  /// Ticks without a motion, with nothing new to analyse, until the modes belong to `tick_number`.
  bool wait_for(std::uint64_t tick_number) {
    using std::chrono::steady_clock;
    const auto end = steady_clock::now() + testing::kHang;
    while (controller.vibration().tick != tick_number && steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      tick(false);
    }
    return controller.vibration().tick == tick_number;
  }

  double time = 0;
};

/// Each tick counts once.
std::uint64_t due_ticks(const VibrationCounters& counters) {
  return counters.tracked + counters.reused + counters.direct + counters.unchanged +
         counters.no_springs + counters.failed + counters.missed;
}

void expect_same_modes(const Vibration& a, const Vibration& b) {
  EXPECT_EQ(a.position, b.position);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.zero_modes, b.zero_modes);
  ASSERT_EQ(a.count, b.count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(a.count); ++i) {
    EXPECT_EQ(a.modes[i].label, b.modes[i].label);
    EXPECT_EQ(a.modes[i].kind, b.modes[i].kind);
    EXPECT_EQ(a.modes[i].eigenvalues, b.modes[i].eigenvalues);
    EXPECT_EQ(a.modes[i].damping_ratio, b.modes[i].damping_ratio);
    EXPECT_EQ(a.modes[i].error_bound, b.modes[i].error_bound);
    EXPECT_EQ(a.modes[i].shape, b.modes[i].shape);
  }
}

/// The thread has the time to solve every task: the same numbers to the last bit.
TEST(VibrationThread, GivesTheNumbersOfTheTick) {
  const RobotModel model = panda_model();
  SwingingArm apart(model, Analysis::Where::kBackground);
  SwingingArm within(model, Analysis::Where::kInline);
  for (int k = 0; k < 200; ++k) {
    apart.tick();
    const std::uint64_t number = apart.controller.snapshot().tick;
    within.tick();
    const Vibration expected = within.controller.vibration();
    ASSERT_TRUE(apart.wait_for(number)) << "tick " << k;
    while (within.controller.snapshot().tick < apart.controller.snapshot().tick) within.tick(false);
    ASSERT_EQ(apart.torque, within.torque);
    ASSERT_NO_FATAL_FAILURE(expect_same_modes(apart.controller.vibration(), expected));
  }
  EXPECT_EQ(apart.controller.vibration().counters.missed, 0u);
  EXPECT_GT(apart.controller.vibration().counters.tracked, 150u);
}

/// As fast as it goes: what it finds is right within the bounds, ticks are missed and counted.
TEST(VibrationThread, KeepsUpAsFarAsItCan) {
  const RobotModel model = panda_model();
  SwingingArm apart(model, Analysis::Where::kBackground);
  SwingingArm within(model, Analysis::Where::kInline);
  std::vector<Vibration> expected(1);
  for (int k = 0; k < 3000; ++k) {
    apart.tick();
    within.tick();
    ASSERT_EQ(apart.torque, within.torque);
    expected.push_back(within.controller.vibration());
    const Vibration& modes = apart.controller.vibration();
    if (modes.tick == 0) continue;
    ASSERT_LE(modes.tick, apart.controller.snapshot().tick);
    const Vibration& same = expected[static_cast<std::size_t>(modes.tick)];
    ASSERT_EQ(modes.position, same.position);
    ASSERT_EQ(modes.count, same.count);
    for (std::size_t i = 0; i < static_cast<std::size_t>(modes.count); ++i) {
      const VibrationMode &a = modes.modes[i], &b = same.modes[i];
      EXPECT_LE(std::abs(a.eigenvalues[0] - b.eigenvalues[0]), a.error_bound + b.error_bound);
    }
    if (k % 100 == 0) std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  ASSERT_TRUE(apart.wait_for(3000));  // the last one is not missed
  EXPECT_EQ(due_ticks(apart.controller.vibration().counters), 3000u);
}

/// Modes from before a reset are not shown after it.
TEST(VibrationThread, ForgetsAtAReset) {
  const RobotModel model = panda_model();
  SwingingArm arm(model, Analysis::Where::kBackground);
  for (int round = 0; round < 20; ++round) {
    arm.tick();
    arm.controller.reset();
    EXPECT_EQ(arm.controller.vibration().tick, 0u);
    EXPECT_EQ(arm.controller.vibration().count, 0);
    if (round % 2 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    for (int k = 0; k < 20; ++k) arm.tick();
    EXPECT_LE(arm.controller.vibration().tick, 20u);
    ASSERT_TRUE(arm.wait_for(20));
    EXPECT_EQ(due_ticks(arm.controller.vibration().counters), 20u);
    EXPECT_LT(arm.controller.vibration().counters.missed, 20u);
    EXPECT_LE(arm.controller.vibration().counters.tracked, 20u);
    arm.tick(false);
  }
}

TEST(VibrationThread, EndsWithItsController) {
  const RobotModel model = panda_model();
  for (int round = 0; round < 20; ++round) {
    SwingingArm arm(model, Analysis::Where::kBackground);
    if (round % 2 == 0) arm.tick();
  }
}

}  // namespace
}  // namespace dashpot::controller
