// Results of the default gains on every arm, at any posture.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/tests/support/arms.hpp>

#include <gtest/gtest.h>

#include <algorithm>

namespace dashpot::controller {
namespace {

constexpr int kPostures = 128, kJudged = 12;

struct Ratios {
  double least = 1e9, most = 0;
  int count = 0, soft = 0;
};

/// Returns the ratios of the modes that are not soft, over the workspace.
Ratios ratios(const RobotModel& model, const Settings& settings, Mode mode) {
  const PostureSequence postures(settings.limits.position_lower, settings.limits.position_upper);
  PostureLoop loop(model, settings);
  analysis::SpectrumOptions options;
  options.soft_frequency = kSoftFrequency;
  Ratios found;
  for (int k = 0; k < kPostures; ++k) {
    analysis::System<kMaxJoints> system;
    const Status status = loop.closed_loop(postures.at(k), settings.initial.gains, mode, system);
    EXPECT_EQ(status, Status::kOk);
    analysis::System<> here(model.dof());
    here.mass = system.mass;
    here.damping = system.damping;
    here.stiffness = system.stiffness;
    for (const auto& one : analysis::analyze(here, options).modes) {
      const bool soft = one.kind == analysis::ModeKind::kSoft;
      ++(soft ? found.soft : found.count);
      if (soft) continue;
      found.least = std::min(found.least, one.damping_ratio);
      found.most = std::max(found.most, one.damping_ratio);
    }
  }
  return found;
}

class DefaultGains : public ::testing::TestWithParam<testing::Arm> {};

TEST_P(DefaultGains, DampEveryModeOverTheWorkspace) {
  ModelOptions smooth;  // friction adds to the ratios, and depends on the model
  smooth.viscous_friction = JointVector::Zero(testing::arm_model(GetParam()).dof());
  const RobotModel model = testing::arm_model(GetParam(), smooth);
  const Settings settings = default_settings(model);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    const bool joint = mode == Mode::kJoint;
    const Ratios found = ratios(model, settings, mode);
    RecordProperty(joint ? "joint" : "cartesian", std::to_string(found.least) + " to " +
                                                      std::to_string(found.most) + ", " +
                                                      std::to_string(found.soft) + " soft");
    EXPECT_GE(found.least, 0.6);
    EXPECT_LE(found.most, 1.1);
    EXPECT_EQ(found.soft + found.count, kPostures * model.dof());
    EXPECT_LE(found.soft, found.count / 60);
    if (!joint) continue;
    EXPECT_NEAR(found.least, 0.7, 1e-6);
    EXPECT_NEAR(found.most, 0.7, 1e-6);
  }
}

/// In a loop of 1 kHz whose torque comes a tick late.
TEST_P(DefaultGains, LeaveTheSampledLoopItsMargin) {
  const RobotModel model = testing::arm_model(GetParam());
  Settings settings = default_settings(model);
  settings.analysis.sampled.delay = 1;
  settings.limits.gain_margin = 5;
  GainJudge judge(model, settings);
  const PostureSequence postures(settings.limits.position_lower, settings.limits.position_upper);
  for (int k = 0; k < kJudged; ++k) {
    ASSERT_GE(judge.judge(postures.at(k), settings.initial.gains).margin, 5) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Arms, DefaultGains, ::testing::ValuesIn(testing::all_arms()),
                         [](const auto& given) { return std::string(given.param.file); });

}  // namespace
}  // namespace dashpot::controller
