// The sampled loop, analysed on a thread: the numbers of analysis::sample_loop for that loop.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>
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

TEST(SampledAnalysis, FindsWhatTheAnalysisOfThatLoopFinds) {
  for (const bool difference : {false, true}) {
    StillArm arm({0.02, 2, 40, difference});
    const SampledVibration* found = arm.wait_for(20);  // the gains have grown
    ASSERT_NE(found, nullptr);
    EXPECT_EQ(found->status, analysis::Status::kOk);
    EXPECT_EQ(found->position, arm.state.position);

    analysis::System<kMaxJoints> loop;
    arm.controller.closed_loop(loop);
    analysis::System<> system(7);
    system.mass = loop.mass;
    system.damping = loop.damping;
    system.stiffness = loop.stiffness;
    system.stiffness_factor = loop.stiffness_factor;
    const analysis::Spectrum<> continuous = analysis::analyze(system);
    analysis::SampledLoop drives;
    drives.delay = 2;
    drives.torque_cutoff = 40;
    drives.difference_velocity = difference;
    drives.friction =
        Eigen::VectorXd(arm.model.joint_values(&Joint::viscous_friction)).asDiagonal();
    drives.gravity_gradient = gravity_gradient(DynamicsKernel(arm.model), arm.state.position);
    const analysis::SampledSpectrum sampled = analysis::sample_loop(system, continuous, drives);
    ASSERT_EQ(static_cast<std::size_t>(found->count), sampled.modes.size());
    ASSERT_GE(found->count, 6);
    EXPECT_NEAR(found->spectral_radius, sampled.spectral_radius, 1e-12);
    EXPECT_NEAR(found->gain_margin, analysis::gain_margin(system, continuous, drives), 1e-6);
    for (std::size_t i = 0; i < sampled.modes.size(); ++i) {
      const SampledVibrationMode& mode = found->modes[i];
      const analysis::SampledMode& wanted = sampled.modes[i];
      const auto& origin = continuous.modes[static_cast<int>(i)];
      EXPECT_EQ(mode.kind, wanted.kind);
      EXPECT_NEAR(mode.continuous_frequency, origin.natural_frequency,
                  1e-12 * origin.natural_frequency);
      EXPECT_NEAR(mode.continuous_ratio, origin.damping_ratio, 1e-12);
      EXPECT_NEAR(mode.natural_frequency, wanted.natural_frequency,
                  1e-9 * origin.natural_frequency);
      EXPECT_NEAR(mode.damping_ratio, wanted.damping_ratio, 1e-9 * origin.natural_frequency);
      EXPECT_NEAR(mode.damped_frequency, wanted.damped_frequency, 1e-9 * origin.natural_frequency);
    }
  }
}

TEST(SampledAnalysis, TellsWhereDelayTakesTheStabilityAway) {
  StillArm prompt({0.02, 0, 0, false}), late({0.02, 20, 0, false});
  const SampledVibration* found = prompt.wait_for(20);
  ASSERT_NE(found, nullptr);
  EXPECT_LT(found->spectral_radius, 1);
  EXPECT_GT(found->gain_margin, 1);
  found = late.wait_for(20);
  ASSERT_NE(found, nullptr);
  EXPECT_GT(found->spectral_radius, 1);
  EXPECT_LT(found->gain_margin, 1);
}

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
