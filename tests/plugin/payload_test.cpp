// Settings of the tip: its payload, and its speed limit.
#include <dashpot/tests/plugin/panda_host.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace dashpot::tests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

dashpot_payload payload(double mass, const double* tool_position = nullptr) {
  auto result = sized<dashpot_payload>();
  result.mass = mass;
  result.center[2] = 0.05;
  for (int i = 0; i < 3; ++i) result.inertia[4 * i] = 1e-3 * mass;
  result.tool_position = tool_position;
  return result;
}

/// A Panda at rest with a configured payload.
Host carrying_host(const std::string& carried, const std::string& settings) {
  std::string text = panda();
  text.replace(text.rfind('}'), 1, ", payload: {" + carried + "}}");
  text += settings;
  Host host(create(text), panda_posture());
  const auto model = load(text).model;
  const controller::JointVector q = joint_vector(panda_posture());
  const Eigen::VectorXd gravity =
      controller::evaluate(model, q, controller::JointVector::Zero(7)).gravity;
  EXPECT_EQ(plugin().reset(host.controller.get(), gravity.data()), DASHPOT_OK);
  return host;
}

/// Gains of its own, because the default ones depend on the configuration.
const std::string kGains =
    std::string(kCartesian) +
    "gains: {task: {stiffness: [500, 500, 500, 30, 30, 30], damping: [40, 40, 40, 3, 3, 3]}, "
    "null_space: {stiffness: 10, damping: 2}}\n";

TEST(PluginPayload, IsRefusedWithAReason) {
  Host host = panda_host(kCartesian);
  host.tick();
  dashpot_controller* const arm = host.controller.get();
  EXPECT_EQ(plugin().set_payload(arm, nullptr), DASHPOT_NULL_ARGUMENT);
  dashpot_payload wrong = payload(1);
  wrong.struct_size = 8;
  EXPECT_EQ(plugin().set_payload(arm, &wrong), DASHPOT_WRONG_STRUCT_SIZE);
  const auto reason = [&](const dashpot_payload& given) {
    EXPECT_EQ(plugin().set_payload(arm, &given), DASHPOT_WRONG_VALUE);
    return std::string(plugin().last_error());
  };
  EXPECT_THAT(reason(payload(-1)), HasSubstr("its mass is negative, -1 kg"));
  EXPECT_THAT(reason(payload(std::nan(""))), HasSubstr("not a finite number"));
  wrong = payload(1);
  wrong.inertia[0] = 1;
  EXPECT_THAT(reason(wrong), HasSubstr("triangle inequality"));
  EXPECT_THAT(reason(payload(30)), HasSubstr("to hold the weight here, limits.torque allows"));
  for (int i = 0; i < 600; ++i) host.tick();
  EXPECT_EQ(host.snapshot().payload_mass, 0);
}

TEST(PluginPayload, IsJudgedWithTheGainsInForce) {
  // Damping that a heavy wrist tolerates and a light one does not.
  Host host = carrying_host("mass: 3, center: [0, 0, 0.1], inertia: [0.3, 0.3, 0.3]",
                            "gains: {joint: {stiffness: [500, 500, 500, 500, 300, 300, 300], "
                            "damping: [50, 50, 50, 50, 30, 30, 45]}}\n");
  ASSERT_NE(host.controller, nullptr) << plugin().last_error();
  host.tick();
  const dashpot_payload nothing = payload(0);
  EXPECT_EQ(plugin().set_payload(host.controller.get(), &nothing), DASHPOT_UNSTABLE_GAINS);
  EXPECT_THAT(plugin().last_error(), HasSubstr("gain margin"));
  for (int i = 0; i < 600; ++i) host.tick();
  EXPECT_NEAR(host.snapshot().payload_mass, 3, 1e-12);
  // The refused payload is forgotten: gains are judged with the present one.
  double margin = 0;
  EXPECT_EQ(plugin().judge_gains(host.controller.get(), nullptr, nullptr, &margin),
            DASHPOT_NULL_ARGUMENT);
  dashpot_gains same = panda_gains();
  EXPECT_EQ(plugin().judge_gains(host.controller.get(), &same, nullptr, &margin), DASHPOT_OK);
}

/// Gains of the joint mode, diagonal.
struct JointGains {
  JointGains(double stiffness, double damping) {
    for (std::size_t i = 0; i < 7; ++i) {
      K[8 * i] = stiffness;
      D[8 * i] = damping;
    }
    gains.struct_size = sizeof gains;
    gains.joints = 7;
    gains.joint_stiffness = K.data();
    gains.joint_damping = D.data();
  }
  JointGains(const JointGains&) = delete;
  JointGains& operator=(const JointGains&) = delete;
  std::array<double, 49> K{}, D{};
  dashpot_gains gains{};
};

TEST(PluginPayload, IsJudgedWithTheGainsThatComeWithIt) {
  Host host = carrying_host("mass: 3, center: [0, 0, 0.1], inertia: [0.3, 0.3, 0.3]",
                            "gains: {joint: {stiffness: 300, damping: 45}}\n");
  dashpot_controller* const arm = host.controller.get();
  ASSERT_NE(arm, nullptr) << plugin().last_error();
  host.tick();
  const JointGains soft(50, 5), hard(300, 60);
  dashpot_payload nothing = payload(0);
  ASSERT_EQ(plugin().set_payload(arm, &nothing), DASHPOT_UNSTABLE_GAINS);
  // A payload that is refused changes nothing, and its gains change nothing.
  nothing.gains = &hard.gains;
  ASSERT_EQ(plugin().set_payload(arm, &nothing), DASHPOT_UNSTABLE_GAINS);
  dashpot_gains wrong{};
  nothing.gains = &wrong;
  EXPECT_EQ(plugin().set_payload(arm, &nothing), DASHPOT_WRONG_STRUCT_SIZE);
  for (int i = 0; i < 600; ++i) host.tick();
  EXPECT_NEAR(host.snapshot().payload_mass, 3, 1e-12);
  const double before = host.modes().modes[0].natural_frequency;
  // Either alone would do harm; together they are taken, and begin in one tick.
  nothing.gains = &soft.gains;
  ASSERT_EQ(plugin().set_payload(arm, &nothing), DASHPOT_OK) << plugin().last_error();
  EXPECT_STREQ(plugin().last_error(), "");
  for (int i = 0; i < 250; ++i) host.tick();
  EXPECT_NEAR(host.snapshot().payload_mass, 1.5, 1e-12);
  for (int i = 0; i < 350; ++i) host.tick();
  EXPECT_EQ(host.snapshot().payload_mass, 0);
  Host bare = panda_host("gains: {joint: {stiffness: 50, damping: 5}}\n");
  for (int i = 0; i < 600; ++i) bare.tick();
  const double wanted = bare.modes().modes[0].natural_frequency;
  EXPECT_NEAR(host.modes().modes[0].natural_frequency, wanted, 1e-6 * before);
  EXPECT_GT(std::abs(before - wanted), 0.01 * before);
  // Without a loop as well.
  auto there = sized<dashpot_modes>();
  ASSERT_EQ(
      plugin().analyze(arm, host.position.data(), DASHPOT_MODE_JOINT, &soft.gains, nullptr, &there),
      DASHPOT_OK);
  EXPECT_NEAR(there.modes[0].natural_frequency, wanted, 1e-6 * wanted);
}

TEST(PluginPayload, HasToLeaveRatioDampingItsMarginOnceItIsDropped) {
  const std::string stiff =
      "analysis: {sampled: {delay: 2}}\ngains: {task: {stiffness: [1500, 1500, 1500, 80, 80, 80], "
      "damping_ratio: 0.7}}\n";
  Host host = panda_host(kCartesian + stiff);
  dashpot_controller* const arm = host.controller.get();
  ASSERT_NE(arm, nullptr) << plugin().last_error();
  host.tick();
  dashpot_payload body = payload(3);
  for (int i = 0; i < 3; ++i) body.inertia[4 * i] = 0.1;
  EXPECT_EQ(plugin().set_payload(arm, &body), DASHPOT_UNSTABLE_GAINS);
  EXPECT_THAT(plugin().last_error(), HasSubstr("once the payload is dropped; 1.2 is needed"));
  dashpot_gains soft{};
  std::array<double, 36> K{};
  for (std::size_t i = 0; i < 6; ++i) K[7 * i] = i < 3 ? 1500 : 10;
  soft.struct_size = sizeof soft;
  soft.joints = 7;
  soft.task_stiffness = K.data();
  body.gains = &soft;
  EXPECT_EQ(plugin().set_payload(arm, &body), DASHPOT_OK) << plugin().last_error();
  // A configured payload has the same effect.
  std::string text = panda();
  text.replace(text.rfind('}'), 1,
               ", payload: {mass: 3, center: [0, 0, 0.05], inertia: [0.1, 0.1, 0.1]}}");
  EXPECT_EQ(create(text + stiff), nullptr);
  EXPECT_THAT(plugin().last_error(), HasSubstr("gains: with the task gains, whose damping counts"));
  EXPECT_NE(create(text + "analysis: {sampled: {delay: 2}}\n"), nullptr) << plugin().last_error();
}

/// After the arm has moved to a posture that tolerates less damping.
TEST(PluginPayload, IsTakenWithAWarningIfItIsBetterThanWhatIs) {
  Host host = panda_host("gains: {joint: {stiffness: 300, damping: 5}}\n");
  dashpot_controller* const arm = host.controller.get();
  ASSERT_NE(arm, nullptr) << plugin().last_error();
  const std::vector<double> folded{0, -0.2, 0, -2.9, 0, 2.9, 0.785};
  // A little less than the most damping that the start tolerates.
  std::array<double, 49> D{};
  dashpot_gains gains = panda_gains();
  gains.joint_damping = D.data();
  const auto margin = [&](const std::vector<double>& q, double damping) {
    for (std::size_t i = 0; i < 7; ++i) D[8 * i] = i == 0 ? damping : 1;
    double found = 0;
    plugin().judge_gains(arm, &gains, q.data(), &found);
    return found;
  };
  double low = 10, high = 1e4;
  while (high > 1.001 * low) {
    const double middle = std::sqrt(low * high);
    (margin(host.position, middle) >= 2 ? low : high) = middle;
  }
  ASSERT_LT(margin(folded, low), 1.9);
  host.tick();
  margin(host.position, low);
  ASSERT_EQ(plugin().set_gains(arm, &gains), DASHPOT_OK) << plugin().last_error();
  host.position = folded;
  for (int i = 0; i < 100; ++i) host.tick();
  EXPECT_NEAR(host.snapshot().position[3], -2.9, 1e-12);
  margin(folded, 1.02 * low);
  EXPECT_EQ(plugin().set_gains(arm, &gains), DASHPOT_UNSTABLE_GAINS);
  margin(folded, 0.98 * low);
  std::array<double, 36> task_stiffness{}, task_damping{};
  for (std::size_t i = 0; i < 6; ++i) {
    task_stiffness[7 * i] = i < 3 ? 400 : 20;
    task_damping[7 * i] = 0.7;
  }
  gains.task_stiffness = task_stiffness.data();
  gains.task_damping = task_damping.data();
  EXPECT_EQ(plugin().set_gains(arm, &gains), DASHPOT_OK) << plugin().last_error();
  EXPECT_THAT(plugin().last_error(),
              AllOf(HasSubstr("limits.gain_margin asks for 2; taken because it was"),
                    HasSubstr("; task damping: 0.7 is little beside")));
  dashpot_payload body = payload(0.5);
  body.center[0] = 0.3;
  body.gains = &gains;
  EXPECT_EQ(plugin().set_payload(arm, &body), DASHPOT_OK) << plugin().last_error();
  EXPECT_THAT(plugin().last_error(),
              AllOf(HasSubstr("taken because it was"), HasSubstr("; task damping: 0.7 is little")));
  const dashpot_payload nothing = payload(0);
  EXPECT_EQ(plugin().set_payload(arm, &nothing), DASHPOT_UNSTABLE_GAINS);
}

TEST(PluginPayload, ThatIsTooHeavyHereIsTakenIfItIsLighterThanWhatIsCarried) {
  Host host =
      carrying_host("mass: 8, center: [0, 0, 0.05], inertia: [0.008, 0.008, 0.008]", kGains);
  dashpot_controller* const arm = host.controller.get();
  ASSERT_NE(arm, nullptr) << plugin().last_error();
  host.position = {0, 1.5, 0, -0.3, 0, 1.8, 0};  // stretched
  EXPECT_EQ(plugin().start(arm, host.position.data(), nullptr), DASHPOT_WRONG_VALUE);
  EXPECT_THAT(plugin().last_error(), HasSubstr("'panda_joint2' needs 118.72 N m to hold the arm"));
  host.tick();
  const dashpot_payload heavier = payload(9), lighter = payload(7);
  EXPECT_EQ(plugin().set_payload(arm, &heavier), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(plugin().set_payload(arm, &lighter), DASHPOT_OK) << plugin().last_error();
}

TEST(PluginPayload, LeavesTheArmWhereItIsWithANewTool) {
  Host host = panda_host(kCartesian);
  host.tick();
  const dashpot_snapshot start = host.snapshot();
  auto goal = sized<dashpot_setpoint>();
  goal.joints = 7;
  goal.mode = DASHPOT_MODE_CARTESIAN;
  goal.tip_position = start.tip_position;
  goal.tip_rotation = start.tip_rotation;
  goal.time = DASHPOT_ON_ARRIVAL;
  ASSERT_EQ(plugin().set_setpoint(host.controller.get(), &goal), DASHPOT_OK);
  for (int i = 0; i < 400; ++i) host.tick();
  const std::vector<double> torque = host.torque;
  const double offset[3] = {0, 0.02, 0.1};
  const dashpot_payload tool = payload(0, offset);
  ASSERT_EQ(plugin().set_payload(host.controller.get(), &tool), DASHPOT_OK);
  // The goal given in the same tick is still one of the old T.
  goal.time = host.time + 1'000'000;
  host.tick(&goal);
  for (int i = 0; i < 800; ++i) {
    host.tick();
    for (std::size_t k = 0; k < 7; ++k) ASSERT_NEAR(host.torque[k], torque[k], 1e-6) << i;
  }
  const dashpot_snapshot end = host.snapshot();
  EXPECT_NEAR(end.tool_position[2], 0.1, 1e-12);
  for (double error : end.tip_error) EXPECT_NEAR(error, 0, 1e-9);
  EXPECT_GT(std::abs(end.tip_position[2] - start.tip_position[2]), 0.05);
}

TEST(PluginTipSpeed, IsAtMostThatOfTheConfiguration) {
  Host host = panda_host(kCartesian);
  dashpot_controller* const arm = host.controller.get();
  const double any = std::numeric_limits<double>::infinity();
  EXPECT_EQ(plugin().limit_tip_speed(nullptr, any, any, any), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().limit_tip_speed(arm, 0.1, any, 0.2), DASHPOT_OK);
  EXPECT_EQ(plugin().limit_tip_speed(arm, 0, any, any), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(plugin().limit_tip_speed(arm, 1e-310, any, any), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(plugin().limit_tip_speed(arm, any, std::nan(""), any), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(plugin().limit_tip_speed(arm, any, any, 100), DASHPOT_WRONG_VALUE);
  EXPECT_THAT(plugin().last_error(),
              HasSubstr("limits.tip_velocity 100: must be at least 0.0001 and at most"));
  host.tick();
  const dashpot_snapshot start = host.snapshot();
  auto goal = sized<dashpot_setpoint>();
  goal.joints = 7;
  goal.mode = DASHPOT_MODE_CARTESIAN;
  double position[3] = {start.tip_position[0], start.tip_position[1] + 0.2, start.tip_position[2]};
  goal.tip_position = position;
  goal.tip_rotation = start.tip_rotation;
  goal.time = DASHPOT_ON_ARRIVAL;
  ASSERT_EQ(plugin().set_setpoint(arm, &goal), DASHPOT_OK);
  double last = start.reference_tip_position[1], fastest = 0;
  const auto model = load(panda()).model;
  for (int i = 0; i < 400; ++i) {
    host.tick();
    simulate(model, host);
    const double now = host.snapshot().reference_tip_position[1];
    fastest = std::max(fastest, 1000 * (now - last));
    last = now;
  }
  EXPECT_NEAR(fastest, 0.1, 1e-4);
}

}  // namespace
}  // namespace dashpot::tests
