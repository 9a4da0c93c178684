// The configurations for `dashpot drive`: results of their gains at any posture.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/tests/plugin/config_file.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <tuple>

namespace dashpot::tests {
namespace {

using controller::Config;
using controller::JointVector;
using controller::Mode;

Config drive_config(const std::string& arm) {
  return controller::load_config(std::string(DASHPOT_SOURCE_DIR) + "/controller/examples/" + arm +
                                 "_drive.yaml");
}

class DriveConfigs : public ::testing::TestWithParam<const char*> {
 protected:
  Config config = drive_config(GetParam());
};

TEST_P(DriveConfigs, AreForADriverThatCompensatesGravity) {
  EXPECT_EQ(config.model.dof(), 7);
  EXPECT_EQ(config.settings.initial.mode, Mode::kJoint);
  EXPECT_EQ(config.settings.period, 1e-3);
  EXPECT_FALSE(config.settings.feed_forward.gravity);
  EXPECT_GE(config.settings.analysis.sampled.delay, 1);
}

/// drive_test.cpp has the margin where each arm begins: `dashpot drive` refuses a smaller one.
TEST_P(DriveConfigs, DampEveryModeWithTheMarginWhereverTheArmIs) {
  const auto& [gains, limits] = std::tie(config.settings.initial.gains, config.settings.limits);
  EXPECT_EQ(gains.joint_damping_ratio, 0.8);
  EXPECT_EQ(limits.gain_margin, 2);
  controller::PostureLoop loop(config.model, config.settings);
  controller::GainJudge judge(config.model, config.settings);
  testing::Random random(77);
  for (int k = 0; k < 150; ++k) {
    JointVector q(7);
    for (int i = 0; i < 7; ++i) {
      q[i] = random.uniform(limits.position_lower[i], limits.position_upper[i]);
    }
    analysis::System<controller::kMaxJoints> system;
    ASSERT_EQ(loop.closed_loop(q, gains, Mode::kJoint, system), controller::Status::kOk);
    analysis::Spectrum<controller::kMaxJoints> spectrum;
    analysis::SpectrumSolver<controller::kMaxJoints>().solve(system, spectrum);
    ASSERT_EQ(spectrum.modes.size(), 7u);
    for (const auto& mode : spectrum.modes) {
      EXPECT_GE(mode.damping_ratio, 0.8 - 1e-6);
      EXPECT_LE(mode.damping_ratio, 0.8 + 0.1);  // friction of the model
    }
    EXPECT_GE(judge.judge(q, gains).margin, 2);
  }
}

INSTANTIATE_TEST_SUITE_P(Arms, DriveConfigs, ::testing::Values("iiwa14", "iiwa7", "panda", "fr3"),
                         [](const auto& given) { return std::string(given.param); });

/// libfranka, lowpass_filter.cpp: y += T / (T + 1 / (2 pi f)) (u - y), with f = 30 Hz.
TEST(DriveConfig, HasTheLowPassOfLibfranka) {
  for (const char* name : {"panda", "fr3"}) {
    const Config config = drive_config(name);
    const double T = config.settings.period;
    const double pole =
        std::exp(-2 * std::numbers::pi * config.settings.analysis.sampled.cutoff * T);
    EXPECT_NEAR(1 - pole, T / (T + 1 / (2 * std::numbers::pi * 30)), 1e-5) << name;
  }
}

/// libfranka, rate_limiting.h: the FR3's limits of velocity at a position.
TEST(DriveConfig, HoldsTheLimitsOfVelocityThatAnFr3HasAtItsPosition) {
  const Config config = drive_config("fr3");
  const auto& limits = config.settings.limits;
  constexpr double kMost[] = {2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26};  // rad/s
  constexpr double kOffset[] = {0.3, 0.2, 0.2, 0.3, 0.35, 0.35, 0.35};
  constexpr double kSlope[] = {12, 5.17, 7, 8, 34, 11, 34};
  constexpr double kUpper[] = {2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196};
  constexpr double kLower[] = {-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196};
  for (int i = 0; i < 7; ++i) {
    for (const double distance :
         {kUpper[i] - limits.position_upper[i], limits.position_lower[i] - kLower[i]}) {
      ASSERT_GT(distance, 0) << i;
      EXPECT_LE(limits.velocity[i],
                std::min(kMost[i], std::sqrt(kSlope[i] * distance) - kOffset[i]))
          << i;
    }
  }
}

}  // namespace
}  // namespace dashpot::tests
