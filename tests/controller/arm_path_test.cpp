// An arm through its stretched singularity at 1 kHz; tests/stress/arm.cpp leads all of them.
#include <dashpot/tests/support/arm_path.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace dashpot::testing {
namespace {

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
