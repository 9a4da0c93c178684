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
#include <ostream>
#include <string>

namespace dashpot::tests {
namespace {

using controller::Config;
using controller::JointVector;
using controller::Mode;

/// A file of controller/examples, and the posture in which the scene of the same name begins, deg.
struct DriveConfig {
  const char* name;
  double start[7];
};
constexpr DriveConfig kIiwa14 = {"iiwa14", {0, 30, 0, -80, 0, 60, 0}};
constexpr DriveConfig kIiwa7 = {"iiwa7", {0, 30, 0, -80, 0, 60, 0}};
constexpr DriveConfig kPanda = {"panda", {0, -45, 0, -135, 0, 90, 45}};
constexpr DriveConfig kFr3 = {"fr3", {0, -45, 0, -135, 0, 90, 45}};

void PrintTo(const DriveConfig& config, std::ostream* out) {
  *out << config.name;
}
std::string config_name(const ::testing::TestParamInfo<DriveConfig>& given) {
  return given.param.name;
}

class DriveConfigs : public ::testing::TestWithParam<DriveConfig> {
 protected:
  Config config = controller::load_config(
      std::string(DASHPOT_SOURCE_DIR) + "/controller/examples/" + GetParam().name + "_drive.yaml");
  controller::GainJudge judge{config.model, config.settings};

  JointVector start() const {
    return Eigen::Map<const Eigen::Matrix<double, 7, 1>>(GetParam().start) * std::numbers::pi / 180;
  }
  JointVector random_posture(testing::Random& random) const {
    JointVector q(7);
    for (int i = 0; i < 7; ++i) {
      q[i] = random.uniform(config.settings.limits.position_lower[i],
                            config.settings.limits.position_upper[i]);
    }
    return q;
  }
  double margin(const JointVector& q) {
    return judge.judge(q, config.settings.initial.gains).margin;
  }
};

TEST_P(DriveConfigs, AreForADriverThatCompensatesGravity) {
  EXPECT_EQ(config.model.dof(), 7);
  EXPECT_EQ(config.settings.initial.mode, Mode::kJoint);
  EXPECT_EQ(config.settings.period, 1e-3);
  EXPECT_FALSE(config.settings.feed_forward.gravity);
  EXPECT_GE(config.settings.analysis.sampled.delay, 1);
}

TEST_P(DriveConfigs, HaveTheMarginWhereTheArmBegins) {
  EXPECT_EQ(config.settings.limits.gain_margin, 2);
  EXPECT_GE(margin(start()), 2);
}

/// With damping that is designed for a ratio.
class DesignedDriveConfigs : public DriveConfigs {};

TEST_P(DesignedDriveConfigs, DampEveryModeWhereverTheArmIs) {
  const double ratio = config.settings.initial.gains.joint_damping_ratio;
  EXPECT_EQ(ratio, 0.8);
  controller::PostureLoop loop(config.model, config.settings);
  testing::Random random(77);
  analysis::System<controller::kMaxJoints> system;
  double least = 1e9, most = 0, least_margin = 1e9, fastest = 0;
  for (int k = 0; k < 150; ++k) {
    const JointVector q = random_posture(random);
    ASSERT_EQ(loop.closed_loop(q, config.settings.initial.gains, Mode::kJoint, system),
              controller::Status::kOk);
    analysis::System<> loop_here(7);
    loop_here.mass = system.mass;
    loop_here.damping = system.damping;
    loop_here.stiffness = system.stiffness;
    const analysis::Spectrum<> spectrum = analysis::analyze(loop_here);
    ASSERT_EQ(spectrum.modes.size(), 7u);
    for (const auto& mode : spectrum.modes) {
      least = std::min(least, mode.damping_ratio);
      most = std::max(most, mode.damping_ratio);
      fastest = std::max(fastest, mode.natural_frequency);
    }
    least_margin = std::min(least_margin, margin(q));
  }
  RecordProperty("ratios", std::to_string(least) + " to " + std::to_string(most));
  RecordProperty("fastest", std::to_string(fastest));
  RecordProperty("margin", std::to_string(least_margin));
  EXPECT_GE(least, ratio - 1e-6);
  EXPECT_LE(most, ratio + 0.1);  // friction of the model
  EXPECT_GE(least_margin, 2);
}

INSTANTIATE_TEST_SUITE_P(Arms, DriveConfigs, ::testing::Values(kIiwa14, kIiwa7, kPanda, kFr3),
                         config_name);
INSTANTIATE_TEST_SUITE_P(Arms, DesignedDriveConfigs,
                         ::testing::Values(kIiwa14, kIiwa7, kPanda, kFr3), config_name);

/// libfranka, lowpass_filter.cpp: y += T / (T + 1 / (2 pi f)) (u - y), with the driver's f of 30
/// Hz.
TEST(DriveConfig, HasTheLowPassOfLibfranka) {
  for (const char* name : {"panda", "fr3"}) {
    const Config config = controller::load_config(std::string(DASHPOT_SOURCE_DIR) +
                                                  "/controller/examples/" + name + "_drive.yaml");
    const double T = config.settings.period;
    const double pole =
        std::exp(-2 * std::numbers::pi * config.settings.analysis.sampled.cutoff * T);
    EXPECT_NEAR(1 - pole, T / (T + 1 / (2 * std::numbers::pi * 30)), 1e-5) << name;
  }
}

/// libfranka, rate_limiting.h: the FR3's limits of velocity at a position.
TEST(DriveConfig, HoldsTheLimitsOfVelocityThatAnFr3HasAtItsPosition) {
  const Config config = controller::load_config(std::string(DASHPOT_SOURCE_DIR) +
                                                "/controller/examples/fr3_drive.yaml");
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
