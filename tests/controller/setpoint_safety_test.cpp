// Set-points that are wrong, old, far away, or come with new springs.
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/safety.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>

namespace dashpot::controller {
namespace {

using testing::kInfinity;
using testing::near;
using testing::Safety;
TEST_F(Safety, RejectsBadSetpointsAndKeepsTheLastGoodOne) {
  run(1.0);
  const double nan = std::nan("");
  // setpoint_check_test.cpp has all bounds.
  const std::vector<std::pair<const char*, std::function<void(Setpoint&)>>> spoilers = {
      {"NaN", [&](Setpoint& s) { s.joint_position[2] = nan; }},
      {"indefinite", [](Setpoint& s) { s.gains.joint_damping(0, 0) = -1; }},
      {"infinite gain", [](Setpoint& s) { s.gains.joint_stiffness(0, 0) = kInfinity; }},
      {"time to come", [](Setpoint& s) { s.time += 1'000'000'000; }},
      {"no rotation", [](Setpoint& s) { s.mode = Mode::kCartesian, s.tip_pose.rotation *= 1.001; }},
      {"reflection", [](Setpoint& s) { s.mode = Mode::kCartesian, s.tip_pose.rotation *= -1.0; }},
  };
  for (const auto& [name, spoil] : spoilers) {
    SCOPED_TRACE(name);
    const Setpoint good = arm->setpoint;
    arm->state.time += 1'000'000;
    arm->setpoint.time = arm->state.time;
    spoil(arm->setpoint);
    EXPECT_EQ(tick(), Status::kSetpointRejected);
    EXPECT_TRUE(near(arm->torque, gravity(), 1e-6));
    arm->state.time += 1'000'000;
    EXPECT_EQ(tick(), Status::kSetpointRejected);  // checked once, reported as long as it stays
    arm->setpoint = good;
    EXPECT_EQ(next(), Status::kOk);
    EXPECT_EQ(snapshot().restarts, 1u);
  }
}

TEST_F(Safety, HoldsWithAStaleSetpointThenDampsAndRecovers) {
  run(1.0);
  arm->setpoint.joint_position[0] += 1.0;
  for (int k = 0; k < 600; ++k) arm->step();
  arm->fresh = false;  // in the middle of its way
  for (int k = 0; k < 500; ++k) EXPECT_EQ(arm->step(), Status::kOk);
  for (int k = 0; k < 1200; ++k) {
    arm->step();
    if (k > 1) {
      EXPECT_EQ(snapshot().status, Status::kSetpointStale);
    }
  }
  EXPECT_EQ(snapshot().reference_velocity.norm(), 0.0);
  EXPECT_EQ(snapshot().joint_weight, 1.0);
  const JointVector held = snapshot().reference_position;
  EXPECT_LT(held[0], arm->setpoint.joint_position[0] - 0.1);  // stopped on the way
  for (int k = 0; k < 302; ++k) arm->step();
  EXPECT_EQ(snapshot().status, Status::kSetpointLost);
  EXPECT_EQ(snapshot().joint_weight, 0.0);
  const JointVector there = arm->state.position;
  for (int k = 0; k < 1000; ++k) arm->step();
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-3));
  EXPECT_TRUE(near(arm->state.position, there, 1e-3));  // held
  arm->fresh = true;
  for (int k = 0; k < 8000; ++k) arm->step();
  EXPECT_EQ(snapshot().status, Status::kOk);
  EXPECT_EQ(snapshot().restarts, 2u);
  EXPECT_TRUE(near(arm->state.position, arm->setpoint.joint_position, 2e-3));
}

TEST_F(Safety, WithoutAnySetpointItHoldsThenDamps) {
  arm->setpoint = Setpoint();
  arm->fresh = false;
  std::set<Status> seen;
  for (int k = 0; k < 2500; ++k) seen.insert(arm->step());
  EXPECT_EQ(seen, (std::set<Status>{Status::kSetpointRejected, Status::kSetpointStale,
                                    Status::kSetpointLost}));
  EXPECT_TRUE(near(arm->state.position, testing::panda_ready(), 1e-4));
}

TEST_F(Safety, AClockThatGoesBackDoesNotStopTheWatchdog) {
  run(1.0);
  arm->fresh = false;
  for (int k = 0; k < 300; ++k) EXPECT_EQ(next(), Status::kOk);
  arm->state.time -= 3'600'000'000'000;
  EXPECT_EQ(tick(), Status::kTimeBackward);
  int ticks = 0;
  while (next() == Status::kOk && ticks < 3000) ++ticks;
  EXPECT_NEAR(ticks, 200, 2);  // stale half a second after the set-point was given
  EXPECT_EQ(snapshot().status, Status::kSetpointStale);
  while (next() == Status::kSetpointStale && ticks < 5000) ++ticks;
  EXPECT_EQ(snapshot().status, Status::kSetpointLost);
}

TEST_F(Safety, ASetpointFarAheadIsRejectedEvenIfNothingHolds) {
  settings.watchdog.setpoint_hold = 0;
  make();
  run(1.0);
  arm->fresh = false;
  arm->setpoint.time = arm->state.time + 3'600'000'000'000;
  EXPECT_EQ(next(), Status::kSetpointRejected);
}

/// The goal is a pose that the tip cannot reach.
class OutOfReach : public Safety {
 protected:
  OutOfReach() {
    settings.initial.mode = Mode::kCartesian;
    settings.limits.linear_error = 0.2;
    make();
    run(1.0);
    home = arm->setpoint.tip_pose;
  }
  /// Distance from the tip to where its springs are fixed.
  double clamped() const {
    return (snapshot().reference_tip.position - snapshot().tip.position).norm();
  }
  Pose home;
};

TEST_F(OutOfReach, SpringsAreDrawnOutNoFartherThanTheirReach) {
  arm->setpoint.tip_pose.position.y() += 5;
  double largest = 0;
  for (int k = 0; k < 5000; ++k) {
    next();  // an obstacle stops the robot
    largest = std::max(largest, clamped());
  }
  EXPECT_LT(largest, 0.2 + 1e-9);
  EXPECT_NEAR(clamped(), 0.2, 1e-6);  // it pulls with its largest force
  EXPECT_TRUE(snapshot().reference_twist.isZero(1e-6));
  const double pull = settings.initial.gains.task_stiffness(1, 1) * 0.2;
  EXPECT_NEAR(snapshot().tip_wrench[1], pull, 1e-3 * pull);
  // Pushed further away at once, it is pulled no harder.
  arm->state.position[0] -= 0.004;
  EXPECT_LE(next(), Status::kTorqueLimited);
  EXPECT_GT(clamped(), 0.201);
  EXPECT_LT(snapshot().tip_wrench.head<3>().norm(), pull * (1 + 1e-3));
}

TEST_F(OutOfReach, AGoalThatComesBackIsFollowedAtOnce) {
  arm->setpoint.tip_pose.position.y() += 5;
  for (int k = 0; k < 5000; ++k) next();
  arm->setpoint.tip_pose = home;
  for (int k = 0; k < 1200; ++k) next();  // 0.2 m, and not the way of 5 s
  EXPECT_TRUE(near(snapshot().reference_tip.position, home.position, 1e-9));
  EXPECT_TRUE(snapshot().reference_twist.isZero(1e-9));
}

TEST_F(OutOfReach, ADirectionWithoutSpringsDrawsNothingOut) {
  arm->setpoint.gains.task_stiffness(2, 2) = 0;
  arm->setpoint.gains.task_damping(2, 2) = 0;
  arm->setpoint.tip_pose.position.x() += 0.05;
  arm->setpoint.tip_pose.position.z() += 5;
  for (int k = 0; k < 40000; ++k) next();
  EXPECT_NEAR(snapshot().reference_tip.position.x(), home.position.x() + 0.05, 1e-9);
}

TEST_F(Safety, JointSpringsThatGrowFromZeroStartWhereTheRobotIs) {
  run(1.0);
  arm->setpoint.gains.joint_stiffness.setZero();
  run(1.0);
  arm->state.external_wrench[1] = 5;
  for (int k = 0; k < 1000; ++k) arm->step();
  arm->state.external_wrench.setZero();
  run(1.0);
  const JointVector there = arm->state.position;
  ASSERT_GT((there - arm->setpoint.joint_position).norm(), 0.1);
  EXPECT_TRUE(near(snapshot().reference_position, arm->setpoint.joint_position, 1e-12));
  arm->setpoint.gains = settings.initial.gains;
  arm->setpoint.gains.joint_stiffness.row(0).setZero();  // joint 1 stays without
  arm->setpoint.gains.joint_stiffness.col(0).setZero();
  arm->step();
  const JointVector at = snapshot().reference_position;
  EXPECT_TRUE(near(at.tail(6), there.tail(6), 1e-3));
  EXPECT_NEAR(at[0], arm->setpoint.joint_position[0], 1e-12);
  arm->setpoint.gains = settings.initial.gains;
  run(8.0);
  EXPECT_TRUE(near(arm->state.position, arm->setpoint.joint_position, 1e-3));
}

TEST_F(Safety, TaskSpringsThatGrowFromZeroStartWhereTheTipIs) {
  for (const Frame frame : {Frame::kBase, Frame::kTool}) {
    settings.initial.mode = Mode::kCartesian;
    settings.initial.gains.frame = frame;
    make();
    run(1.0);
    const Pose home = arm->setpoint.tip_pose;
    arm->setpoint.gains.task_stiffness(2, 2) = 0;
    run(1.0);
    arm->state.external_wrench[2] = 3;
    for (int k = 0; k < 1000; ++k) arm->step();
    arm->state.external_wrench.setZero();
    run(1.0);
    const Pose there = arm->tip();
    ASSERT_GT((there.position - home.position).norm(), 0.03);
    arm->setpoint.gains = settings.initial.gains;
    arm->step();
    const Eigen::Vector3d off = snapshot().reference_tip.position - there.position;
    const Eigen::Vector3d in_frame =
        frame == Frame::kTool ? Eigen::Vector3d(there.rotation.transpose() * off) : off;
    EXPECT_NEAR(in_frame.z(), 0, 1e-3);
    run(6.0);
    EXPECT_TRUE(near(arm->tip().position, home.position, 2e-3));
  }
}

}  // namespace
}  // namespace dashpot::controller
