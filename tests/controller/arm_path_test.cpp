// Each arm through its stretched singularity at 1 kHz, as far as a test has time for it;
// tests/stress/arm.cpp leads them all the way and back.
#include <dashpot/tests/support/arm_path.hpp>
#include <dashpot/tests/support/enclosure.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace dashpot::testing {
namespace {

void lead(const Arm& arm, const GainScales& scales) {
  const auto watched = std::make_unique<WatchedArm>(arm_model(arm), scales, arm.file);
  bool was_soft = false;
  for (int tick = 0; tick <= 300; ++tick) {
    watched->step(0.25 + (tick - 150) / 20'000.0);  // stretched in the middle
    for (const auto& mode : watched->spectrum().modes) {
      was_soft |= mode.kind == analysis::ModeKind::kSoft;
    }
    if (tick % 30 != 0) continue;
    const Verdict verdict = judge(watched->system(), watched->spectrum(), 0);
    ASSERT_TRUE(verdict.enclosed) << "tick " << tick << ": " << verdict.what;
  }
  EXPECT_TRUE(was_soft ||
              (arm_model(arm).dof() == 7 && scales.null_space > 0));  // null space takes its place
  const ModeWatch& watch = watched->watch();
  EXPECT_GT(watch.separated, 150);
  EXPECT_EQ(watch.lost, 0);
  EXPECT_LT(watch.largest_change, 0.02);
  EXPECT_EQ(watch.not_numbers, 0);
  EXPECT_EQ(watch.bounds_missing, 0);
  EXPECT_GE(watched->counters().tracked, 295);
  EXPECT_EQ(watched->counters().failed, 0);
}

TEST(ArmPath, KeepsItsModesThroughTheStretchedSingularity) {
  for (const Arm& arm : arms()) {
    for (const GainScales& scales : {GainScales{1, 1}, GainScales{0.1, 0}}) {
      SCOPED_TRACE(std::string(arm.file) + ", damping " + std::to_string(scales.damping));
      lead(arm, scales);
    }
  }
}

/// The tip's springs have as many rows as there are joints: nothing may turn them at once.
TEST(ArmPath, OfSixJointsPassesASingularityBetweenTwoTicks) {
  ArmLoop loop(arm_model(arms()[2]), {});
  const auto tracker = std::make_unique<analysis::ModeTracker>();
  const auto spectrum = std::make_unique<analysis::TrackedSpectrum>();
  for (int tick = 300; tick < 450; ++tick) {  // the elbow is stretched after tick 372
    controller::JointVector q(6);
    for (int i = 0; i < 6; ++i) q[i] = 0.2 * std::sin(2 * std::numbers::pi * tick / 2048 + i);
    const std::int64_t before = tracker->counters().iterations;
    ASSERT_EQ(tracker->update(loop.at(q), *spectrum), analysis::Status::kOk);
    EXPECT_LE(tracker->counters().iterations - before, 4);
  }
  EXPECT_EQ(tracker->counters().direct, 1);
}

}  // namespace
}  // namespace dashpot::testing
