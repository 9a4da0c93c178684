// The sampled loop, analysed on a thread: when; its numbers are in one_loop_test.cpp.
#include <dashpot/controller/controller.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace dashpot::controller {
namespace {

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

}  // namespace
}  // namespace dashpot::controller
