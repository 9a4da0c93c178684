// The C interface with arguments that it refuses, or takes for a fault of the robot.
#include <dashpot/tests/plugin/panda_host.hpp>

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <limits>

namespace dashpot::tests {
namespace {

using Eigen::VectorXd;

TEST(PluginRefuses, NullPointers) {
  const Handle arm = create(panda());
  Host host(create(panda()), panda_posture());
  dashpot_output output = host.output();
  const dashpot_state state = host.state();
  EXPECT_EQ(plugin().update(nullptr, &state, nullptr, &output), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().update(arm.get(), &state, nullptr, nullptr), DASHPOT_NULL_ARGUMENT);
  output.torque = nullptr;
  EXPECT_EQ(plugin().update(arm.get(), &state, nullptr, &output), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().reset(nullptr, nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().stop(nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().set_setpoint(nullptr, nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().set_setpoint(arm.get(), nullptr), DASHPOT_NULL_ARGUMENT);
  dashpot_setpoint setpoint = host.joint_setpoint(panda_posture());
  setpoint.joint_position = nullptr;
  EXPECT_EQ(plugin().set_setpoint(arm.get(), &setpoint), DASHPOT_NULL_ARGUMENT);
  setpoint.mode = DASHPOT_MODE_CARTESIAN;
  EXPECT_EQ(plugin().set_setpoint(arm.get(), &setpoint), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().set_gains(arm.get(), nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().read_snapshot(arm.get(), nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().read_modes(nullptr, nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_EQ(plugin().read_sampled_modes(nullptr, nullptr), DASHPOT_NULL_ARGUMENT);
  EXPECT_STREQ(plugin().last_error(), "a required pointer is NULL");
  EXPECT_EQ(plugin().joints(nullptr), 0u);
  EXPECT_EQ(plugin().joint_name(nullptr, 0), nullptr);
  EXPECT_EQ(plugin().period(nullptr), 0);
  plugin().destroy(nullptr);
}

TEST(PluginRefuses, StructsOfAnotherSizeAndRobotsOfAnother) {
  Host host(create(panda()), panda_posture());
  dashpot_controller* const arm = host.controller.get();
  for (const std::uint32_t wrong : {0u, 4u, 1u << 20}) {
    dashpot_output output = host.output();
    output.struct_size = wrong;
    const dashpot_state state = host.state();
    host.torque.assign(7, 123.0);
    EXPECT_EQ(plugin().update(arm, &state, nullptr, &output), DASHPOT_WRONG_STRUCT_SIZE);
    EXPECT_THAT(host.torque, ::testing::Each(123.0));
    dashpot_setpoint setpoint = host.joint_setpoint(panda_posture());
    setpoint.struct_size = wrong;
    EXPECT_EQ(plugin().set_setpoint(arm, &setpoint), DASHPOT_WRONG_STRUCT_SIZE);
    dashpot_gains gains{};
    gains.struct_size = wrong;
    EXPECT_EQ(plugin().set_gains(arm, &gains), DASHPOT_WRONG_STRUCT_SIZE);
    dashpot_snapshot snapshot{};
    snapshot.struct_size = wrong;
    EXPECT_EQ(plugin().read_snapshot(arm, &snapshot), DASHPOT_WRONG_STRUCT_SIZE);
    const auto modes = std::make_unique<dashpot_modes>();
    modes->struct_size = wrong;
    EXPECT_EQ(plugin().read_modes(arm, modes.get()), DASHPOT_WRONG_STRUCT_SIZE);
    EXPECT_STREQ(plugin().last_error(), "struct_size does not match this version of plugin.h");
  }
  dashpot_output output = host.output();
  output.joints = 6;
  const dashpot_state state = host.state();
  EXPECT_EQ(plugin().update(arm, &state, nullptr, &output), DASHPOT_WRONG_JOINTS);
}

/// plugin_data_test.cpp and setpoint_check_test.cpp have all that is refused.
TEST(PluginRefuses, ImpossibleValuesWithAReason) {
  const Host host(create(panda()), panda_posture());
  dashpot_controller* const arm = host.controller.get();
  std::vector<double> goal = panda_posture();
  goal[2] = 3;
  const dashpot_setpoint setpoint = host.joint_setpoint(goal);
  EXPECT_EQ(plugin().set_setpoint(arm, &setpoint), DASHPOT_WRONG_VALUE);
  EXPECT_STREQ(plugin().last_error(), "joint_position is above a position limit");
  dashpot_gains gains = panda_gains();
  const Eigen::Matrix<double, 6, 6> K_C = -Eigen::Matrix<double, 6, 6>::Identity();
  gains.task_stiffness = K_C.data();
  EXPECT_EQ(plugin().set_gains(arm, &gains), DASHPOT_WRONG_VALUE);
  EXPECT_STREQ(plugin().last_error(), "task_stiffness is not positive semidefinite");
}

TEST(PluginRefuses, ToReadBeforeTheFirstTick) {
  const Handle arm = create(panda());
  auto snapshot = sized<dashpot_snapshot>();
  EXPECT_EQ(plugin().read_snapshot(arm.get(), &snapshot), DASHPOT_NOTHING_YET);
  auto modes = sized<dashpot_modes>();
  EXPECT_EQ(plugin().read_modes(arm.get(), &modes), DASHPOT_NOTHING_YET);
  dashpot_sampled_modes sampled{};
  EXPECT_EQ(plugin().read_sampled_modes(arm.get(), &sampled), DASHPOT_WRONG_STRUCT_SIZE);
  sampled.struct_size = sizeof sampled;
  EXPECT_EQ(plugin().read_sampled_modes(arm.get(), &sampled), DASHPOT_NOTHING_YET);
  EXPECT_STREQ(plugin().last_error(), "nothing to read so far");
}

/// A wrong state does not end the loop: the weight is held, and the controller recovers.
TEST(Plugin, IsSafeWithoutAState) {
  Host host = panda_host("watchdog: {feedback: 0}\n");  // the arm stays where it is
  for (int tick = 0; tick < 200; ++tick) ASSERT_EQ(host.tick(), DASHPOT_OK);
  const VectorXd weight = joint_vector(host.torque);
  ASSERT_GT(weight.norm(), 1);
  dashpot_state wrong_size = host.state();
  wrong_size.struct_size = 8;
  dashpot_state wrong_joints = host.state();
  wrong_joints.joints = 6;
  dashpot_state no_position = host.state();
  no_position.position = nullptr;
  const std::array<const dashpot_state*, 4> states = {nullptr, &wrong_size, &wrong_joints,
                                                      &no_position};
  dashpot_output output = host.output();
  for (std::size_t tick = 0; tick < 40; ++tick) {
    ASSERT_EQ(plugin().update(host.controller.get(), states[tick % 4], nullptr, &output),
              DASHPOT_STATE_WRONG_SIZE);
    host.time += 1'000'000;
    ASSERT_LT((joint_vector(host.torque) - weight).norm(), 0.2) << tick;
  }
  EXPECT_EQ(host.snapshot().status, DASHPOT_STATE_WRONG_SIZE);
  EXPECT_EQ(host.tick(), DASHPOT_FAULT_LATCHED);  // the weight comes back, the springs do not
  EXPECT_EQ(host.snapshot().fault, DASHPOT_STATE_WRONG_SIZE);
  ASSERT_EQ(plugin().release(host.controller.get()), DASHPOT_OK);
  EXPECT_LE(host.tick(), DASHPOT_TORQUE_LIMITED);
  EXPECT_EQ(host.snapshot().fault, DASHPOT_OK);
  host.position[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(host.tick(), DASHPOT_STATE_NOT_FINITE);
}

TEST(Plugin, SurvivesAnyTime) {
  Host host = panda_host();
  for (const std::int64_t time : {std::int64_t{0}, std::numeric_limits<std::int64_t>::max(),
                                  std::numeric_limits<std::int64_t>::min(), std::int64_t{5}}) {
    const dashpot_setpoint setpoint = host.joint_setpoint(panda_posture(), time);
    dashpot_state state = host.state();
    state.time = time;
    dashpot_output output = host.output();
    for (int i = 0; i < 3; ++i) {
      EXPECT_GE(plugin().update(host.controller.get(), &state, &setpoint, &output), DASHPOT_OK);
      EXPECT_GE(plugin().update(host.controller.get(), nullptr, nullptr, &output), DASHPOT_OK);
      EXPECT_TRUE(joint_vector(host.torque).allFinite());
    }
  }
}

TEST(Plugin, RejectsAWrongSetpointOfATick) {
  Host host = panda_host();
  ASSERT_EQ(host.tick(), DASHPOT_OK);
  dashpot_setpoint setpoint = host.joint_setpoint(panda_posture());
  setpoint.struct_size = 0;
  EXPECT_EQ(host.tick(&setpoint), DASHPOT_SETPOINT_REJECTED);
  EXPECT_EQ(host.snapshot().status, DASHPOT_SETPOINT_REJECTED);
  EXPECT_EQ(host.tick(), DASHPOT_OK);
  std::vector<double> far = panda_posture();
  far[0] = 4;
  const dashpot_setpoint beyond = host.joint_setpoint(far);
  EXPECT_EQ(host.tick(&beyond), DASHPOT_SETPOINT_REJECTED);
  const dashpot_setpoint good = host.joint_setpoint(panda_posture());
  EXPECT_EQ(host.tick(&good), DASHPOT_OK);
}

// The set-points and gains that remain when a fault is released.

/// An arm that stands still, whose springs can be seen to go elsewhere.
class PluginRelease : public ::testing::Test {
 protected:
  explicit PluginRelease(const std::string& watchdog = "")
      : host(panda_host("watchdog: {feedback: 0" + watchdog + "}\nlimits: {gain_margin: 1}\n")),
        elsewhere(panda_posture()) {
    elsewhere[0] += 0.3;
  }
  dashpot_controller* arm() { return host.controller.get(); }
  /// Whether the springs have moved, some time later.
  bool follows(const dashpot_setpoint* setpoint = nullptr, int ticks = 300) {
    for (int tick = 0; tick < ticks; ++tick) EXPECT_LT(host.tick(setpoint), DASHPOT_SETPOINT_LOST);
    return std::abs(host.snapshot().reference_joint_position[0] - host.position[0]) > 0.01;
  }
  /// A pause that latches, with this set-point.
  void pause(const dashpot_setpoint* setpoint = nullptr) {
    host.time += 50'000'000;
    EXPECT_EQ(host.tick(setpoint), DASHPOT_TIME_GAP);
    EXPECT_EQ(host.tick(setpoint), DASHPOT_FAULT_LATCHED);
  }
  void release() { EXPECT_EQ(plugin().release(arm()), DASHPOT_OK); }
  void set_stiffness(double stiffness) {
    const Eigen::Matrix<double, 7, 7> K = stiffness * Eigen::Matrix<double, 7, 7>::Identity();
    dashpot_gains gains = panda_gains();
    gains.joint_stiffness = K.data();
    ASSERT_EQ(plugin().set_gains(arm(), &gains), DASHPOT_OK) << plugin().last_error();
  }
  /// Returns the stiffness in force, from what a small deflection gives.
  double stiffness() {
    host.position[6] += 1e-3;
    host.tick();
    const double with = host.snapshot().law_torque[6];
    host.position[6] -= 1e-3;
    host.tick();
    return (host.snapshot().law_torque[6] - with) / 1e-3;
  }

  Host host;
  std::vector<double> elsewhere;
};

TEST_F(PluginRelease, EndsASetpointThatIsGivenAtEachTick) {
  const dashpot_setpoint old = host.joint_setpoint(elsewhere, host.time + 1'000'000);
  EXPECT_TRUE(follows(&old));
  pause(&old);
  release();
  EXPECT_FALSE(follows(&old));
  EXPECT_EQ(host.snapshot().fault, DASHPOT_OK);
  EXPECT_EQ(host.snapshot().restarts, 2u);
  EXPECT_FALSE(follows(nullptr));
  const dashpot_setpoint fresh = host.joint_setpoint(elsewhere, host.time + 1'000'000);
  EXPECT_TRUE(follows(&fresh));
  EXPECT_TRUE(follows(&fresh));
}

/// One that has the time of the tick at which it arrives is new at each tick.
TEST_F(PluginRelease, DoesNotEndASetpointOnArrival) {
  const dashpot_setpoint wanted = host.joint_setpoint(elsewhere);
  EXPECT_TRUE(follows(&wanted));
  pause(&wanted);
  release();
  EXPECT_TRUE(follows(&wanted));
}

TEST_F(PluginRelease, EndsASetpointOfTheOtherThreadButNotOneThatFollows) {
  const dashpot_setpoint wanted = host.joint_setpoint(elsewhere);
  ASSERT_EQ(plugin().set_setpoint(arm(), &wanted), DASHPOT_OK);
  EXPECT_TRUE(follows());
  pause();
  release();
  EXPECT_FALSE(follows());
  set_stiffness(30);
  EXPECT_FALSE(follows());
  pause();
  release();
  ASSERT_EQ(plugin().set_setpoint(arm(), &wanted), DASHPOT_OK);  // before the next tick
  EXPECT_TRUE(follows());
}

TEST_F(PluginRelease, KeepsTheGains) {
  EXPECT_FALSE(follows(nullptr, 1000));
  const double before = stiffness();
  set_stiffness(37);
  EXPECT_FALSE(follows(nullptr, 1000));
  EXPECT_NEAR(stiffness(), 37, 0.5);
  ASSERT_GT(std::abs(before - 37), 5);
  for (int k = 0; k < 2; ++k) {
    pause();
    release();
    EXPECT_FALSE(follows(nullptr, 1000));
    EXPECT_NEAR(stiffness(), 37, 0.5) << k;
  }
  ASSERT_EQ(plugin().reset(arm(), host.torque.data()), DASHPOT_OK);
  EXPECT_FALSE(follows(nullptr, 1000));
  EXPECT_NEAR(stiffness(), 37, 0.5);
}

class PluginReleasesByItself : public PluginRelease {
 protected:
  PluginReleasesByItself() : PluginRelease(", release_after: 0.1") {}
  void rest() {
    for (int tick = 0; tick < 110; ++tick) host.tick();
    EXPECT_EQ(host.snapshot().fault, DASHPOT_OK);
  }
};

/// New gains after a release by rest bring nothing old back, also while it is not stale.
TEST_F(PluginReleasesByItself, AndEndsTheSetpoint) {
  const dashpot_setpoint wanted = host.joint_setpoint(elsewhere);
  ASSERT_EQ(plugin().set_setpoint(arm(), &wanted), DASHPOT_OK);
  EXPECT_TRUE(follows(nullptr, 150));
  pause();
  rest();
  set_stiffness(37);
  EXPECT_FALSE(follows(nullptr, 180));
  EXPECT_FALSE(follows(nullptr, 1000));
  EXPECT_NEAR(stiffness(), 37, 0.5);
  ASSERT_EQ(plugin().set_setpoint(arm(), &wanted), DASHPOT_OK);
  EXPECT_TRUE(follows());
}

TEST_F(PluginReleasesByItself, AndEndsOneThatIsGivenAtEachTick) {
  const dashpot_setpoint old = host.joint_setpoint(elsewhere, host.time + 1'000'000);
  EXPECT_TRUE(follows(&old));
  pause(&old);
  for (int tick = 0; tick < 110; ++tick) host.tick(&old);
  EXPECT_EQ(host.snapshot().fault, DASHPOT_OK);
  EXPECT_FALSE(follows(&old));
  release();  // there is nothing to release
  const dashpot_setpoint fresh = host.joint_setpoint(elsewhere, host.time + 1'000'000);
  EXPECT_TRUE(follows(&fresh));
}

}  // namespace
}  // namespace dashpot::tests
