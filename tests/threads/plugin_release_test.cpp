// The set-points and gains that remain when a fault is released.
#include <dashpot/tests/plugin/panda_host.hpp>

#include <cmath>

namespace dashpot::tests {
namespace {

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
