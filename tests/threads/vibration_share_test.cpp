// An analysis that is too long for one tick continues in the background, and reports it.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <thread>

namespace dashpot::controller {

void PrintTo(Mode mode, std::ostream* out) {
  *out << (mode == Mode::kJoint ? "joint" : "cartesian");
}

namespace {

using analysis::SpectrumOrigin;
using analysis::Status;
using testing::in_mode;
using testing::kSmallSwing;
using testing::LedArm;
using testing::panda_model;
using testing::unlimited_settings;

constexpr std::int64_t kBudget = 1'000'000;  // a tenth of 1 ms

/// Springs of 1e-6 beside dampers of 500 and 50: overdamped beyond what doubles can resolve.
Gains hopeless_gains(Gains gains) {
  gains.joint_stiffness.setIdentity(7, 7);
  gains.joint_stiffness *= 1e-6;
  gains.joint_damping.setZero(7, 7);
  gains.joint_damping.diagonal() << 500, 500, 500, 500, 50, 50, 50;
  gains.task_stiffness = 1e-6 * Matrix6::Identity();
  gains.task_damping = Vector6(500, 500, 500, 50, 50, 50).asDiagonal();
  gains.null_stiffness.setZero(7);
  gains.null_damping.setZero(7);
  return gains;
}

struct SharedTick {
  explicit SharedTick(Mode mode, double share = 0.1) : model(panda_model()) {
    Settings settings = in_mode(unlimited_settings(model), mode);
    settings.analysis.share = share;
    settings.motion.gain_time = settings.period;
    led = std::make_unique<LedArm>(model, settings, kSmallSwing);
    led->setpoint.mode = mode;
  }
  /// Does a tick of an arm that moves.
  const Vibration& tick() {
    led->swing(1e-3 * ++k);
    led->tick();
    return led->modes();
  }
  /// Ticks, moving or not, until this is so.
  bool wait_until(bool moving, const std::function<bool(const Vibration&)>& so) {
    using std::chrono::steady_clock;
    const auto end = steady_clock::now() + testing::kHang;
    while (!so(led->modes()) && steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::microseconds(500));
      if (moving) led->swing(1e-3 * ++k);
      led->tick();
      EXPECT_LE(led->modes().work, kBudget);
    }
    return so(led->modes());
  }

  RobotModel model;
  std::unique_ptr<LedArm> led;
  int k = 0;
};

class VibrationShare : public ::testing::TestWithParam<Mode> {};

TEST_P(VibrationShare, IsKeptWhateverTheGainsAre) {
  SharedTick arm(GetParam());
  for (int k = 0; k < 20; ++k) arm.tick();
  ASSERT_EQ(arm.led->modes().status, Status::kOk);
  ASSERT_EQ(arm.led->modes().tick, arm.led->controller.snapshot().tick);
  const std::uint64_t counted = 20;

  arm.led->setpoint.gains = hopeless_gains(arm.led->setpoint.gains);
  ASSERT_TRUE(
      arm.wait_until(true, [](const Vibration& v) { return v.status == Status::kUnfinished; }));
  const Vibration between = arm.led->modes();
  EXPECT_EQ(between.count, 0);
  EXPECT_EQ(between.zero_modes, 0);
  EXPECT_EQ(between.tick, arm.led->controller.snapshot().tick);
  EXPECT_EQ(between.position, arm.led->state.position);
  EXPECT_LE(between.work, kBudget);

  // Its modes, where the arm was when they became too much, and then where it is.
  analysis::System<kMaxJoints> system;
  arm.led->controller.closed_loop(system);
  ASSERT_TRUE(arm.wait_until(false, [](const Vibration& v) { return v.count > 0; }));
  const Vibration& found = arm.led->modes();
  EXPECT_TRUE(found.status == Status::kOk || found.status == Status::kUncertified);
  EXPECT_LE(found.tick, arm.led->controller.snapshot().tick);
  EXPECT_EQ(found.position, arm.led->state.position);
  const auto full = std::make_unique<analysis::Spectrum<kMaxJoints>>();
  std::make_unique<analysis::SpectrumSolver<kMaxJoints>>()->solve(system, *full);
  EXPECT_EQ(found.count + found.zero_modes, 7);
  EXPECT_EQ(found.zero_modes, full->zero_modes.count);

  // And back.
  arm.led->setpoint.gains = arm.led->controller.settings().initial.gains;
  ASSERT_TRUE(arm.wait_until(true, [&](const Vibration& v) {
    return v.origin == SpectrumOrigin::kTracked && v.status == Status::kOk &&
           v.tick == arm.led->controller.snapshot().tick;
  }));
  for (int k = 0; k < 20; ++k) {
    arm.tick();
    EXPECT_EQ(arm.led->modes().tick, arm.led->controller.snapshot().tick);
  }
  const VibrationCounters& counters = arm.led->modes().counters;
  EXPECT_EQ(counters.tracked + counters.reused + counters.direct + counters.unchanged +
                counters.no_springs + counters.failed + counters.missed,
            arm.led->controller.snapshot().tick);
  EXPECT_GT(counters.tracked, counted);
}

/// Modes that cannot be followed are not tried in every tick again.
TEST_P(VibrationShare, IsNotSpentInVain) {
  SharedTick arm(GetParam(), 1e-3);  // nothing fits
  int tried = 0;
  for (int k = 0; k < 300; ++k) {
    tried += arm.tick().work > 0 ? 1 : 0;
    EXPECT_LE(arm.led->modes().work, kBudget / 100);
    if (k % 3 == 0) std::this_thread::sleep_for(std::chrono::microseconds(300));
  }
  EXPECT_LT(tried, 300);
  ASSERT_TRUE(arm.wait_until(false, [](const Vibration& v) { return v.count > 0; }));
}

INSTANTIATE_TEST_SUITE_P(Modes, VibrationShare, ::testing::Values(Mode::kJoint, Mode::kCartesian),
                         [](const auto& mode) {
                           return std::string(mode.param == Mode::kJoint ? "joint" : "cartesian");
                         });

}  // namespace
}  // namespace dashpot::controller
