// Set-points that are wrong, old, far away, or come with new springs.
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/safety.hpp>

#include <gtest/gtest.h>

#include <algorithm>
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

// Set-points and springs from a start on: after a reset, after a fault, between
// modes.

class SetpointHistory : public testing::Safety {
 protected:
  void make_cartesian() {
    settings.initial.mode = Mode::kCartesian;
    make();
    run(1.0);
  }
  void ticks(int count) {
    for (int k = 0; k < count; ++k) next();
  }
  void fault() {  // a gap in time
    arm->state.time += 50'000'000;
    next();
  }
  double full() const { return settings.initial.gains.joint_stiffness(0, 0); }
  /// Returns the current stiffness of the first joint.
  double stiffness() {
    const double before = snapshot().law_torque[0];
    arm->state.position[0] += 1e-3;
    next();
    arm->state.position[0] -= 1e-3;
    return (before - snapshot().law_torque[0]) / 1e-3;
  }
};

/// A reset forgets the set-point, so that the same one is new.
TEST_F(SetpointHistory, GoesToTheSameSetpointAfterAReset) {
  run(1.0);
  arm->setpoint.joint_position[0] += 0.3;
  arm->fresh = false;
  arm->setpoint.time = arm->state.time;
  ticks(100);
  ASSERT_GT(snapshot().joint_error[0], 0.005);
  arm->controller.reset(gravity());
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_NEAR(snapshot().joint_error[0], 0, 1e-3);  // from where the robot is
  ticks(100);
  EXPECT_GT(snapshot().joint_error[0], 0.005);
}

TEST_F(SetpointHistory, ForgetsRestartsWithAReset) {
  run(1.0);
  for (int k = 0; k < 5; ++k) {
    if (k == 3) arm->controller.reset(gravity());
    fault();
    arm->controller.release();
    ticks(20);
    EXPECT_EQ(snapshot().fault, Status::kOk) << k;
  }
}

TEST_F(SetpointHistory, HasModesAtTheFirstTickAfterAReset) {
  settings.analysis.where = Analysis::Where::kInline;
  settings.analysis.share = 1;
  make();
  for (int k = 0; k < 2; ++k) {
    ticks(700);
    const Vibration before = arm->controller.vibration();
    ASSERT_EQ(before.count, 7);
    arm->controller.reset(gravity());
    EXPECT_EQ(arm->controller.vibration().count, 0);
    ticks(700);
    EXPECT_EQ(arm->controller.vibration().count, 7);
    EXPECT_NEAR(arm->controller.vibration().modes[0].natural_frequency,
                before.modes[0].natural_frequency, 1e-6);
  }
}

/// A controller without a reset or a set-point holds with the gains of its settings.
TEST_F(SetpointHistory, HoldsFromTheFirstTickWithTheGainsOfTheSettings) {
  arm->controller = Controller(model, settings);
  arm->setpoint = Setpoint();
  arm->fresh = false;
  ticks(520);
  EXPECT_NEAR(stiffness(), full(), 1e-2 * full());
}

/// After a release velocities are measured again, and no longer smoothed differences.
TEST_F(SetpointHistory, BelievesVelocitiesAfterARelease) {
  settings.watchdog.feedback = 0.5;
  make();
  run(1.0);
  for (int k = 0; k < 100; ++k) {
    arm->state.position[4] += 5e-4;
    next();
  }
  ASSERT_EQ(snapshot().fault, Status::kStateContradictory);
  ticks(3000);
  arm->controller.release();
  ticks(10);
  arm->state.velocity[4] = 0.1;
  arm->state.position[4] += 1e-4;
  next();
  EXPECT_EQ(snapshot().velocity[4], 0.1);
}

/// Springs that start again grow from nothing, within gain_time.
TEST_F(SetpointHistory, SpringsGrowFromZeroAfterAFault) {
  run(1.0);
  ASSERT_EQ(snapshot().joint_weight, 1);
  EXPECT_NEAR(stiffness(), full(), 1e-3 * full());
  fault();
  arm->controller.release();
  next();
  EXPECT_LT(stiffness(), 0.01 * full());
  ticks(246);
  EXPECT_NEAR(stiffness(), 0.5 * full(), 0.01 * full());
  ticks(300);
  EXPECT_NEAR(stiffness(), full(), 1e-3 * full());
}

TEST_F(SetpointHistory, ShowsNoErrorOfATipThatIsNotHeld) {
  make_cartesian();
  arm->setpoint.tip_pose.position.x() += 0.05;
  ticks(600);
  ASSERT_GT(snapshot().tip_error.norm(), 0.01);
  arm->setpoint.mode = Mode::kJoint;
  arm->setpoint.joint_position = arm->state.position;
  ticks(600);
  ASSERT_EQ(snapshot().task_weight, 0);
  EXPECT_EQ(snapshot().tip_error, Vector6(Vector6::Zero()));
  EXPECT_EQ(snapshot().reference_twist, Vector6(Vector6::Zero()));
  EXPECT_EQ(snapshot().reference_tip.position, snapshot().tip.position);
}

/// The path of the tip is as fast as allowed where the joints do not limit it.
TEST_F(SetpointHistory, TheTipGoesAsFastAsItMay) {
  settings.limits.beyond_model = true;
  settings.limits.velocity.setConstant(20);
  make_cartesian();
  arm->setpoint.tip_pose.position.y() += 0.29;  // within the springs' reach
  double fastest = 0;
  for (int k = 0; k < 1500; ++k) {
    next();
    fastest = std::max(fastest, snapshot().reference_twist.norm());
  }
  EXPECT_NEAR(fastest, settings.motion.linear_velocity, 0.01 * settings.motion.linear_velocity);
}

/// In the Cartesian mode, too, the posture moves toward its goal, and stays with a set-point
/// that names none or is stale.
TEST_F(SetpointHistory, TheRestPostureStaysWhereNobodyWantsAnother) {
  make_cartesian();
  const JointVector start = snapshot().reference_position;
  arm->setpoint.joint_position[0] += 1;
  ticks(600);
  EXPECT_GT(snapshot().reference_position[0] - start[0], 0.05);
  EXPECT_GT(snapshot().reference_velocity[0], 0.1);
  arm->setpoint.joint_position.resize(0);
  ticks(600);
  const JointVector there = snapshot().reference_position;
  EXPECT_LT(there[0] - start[0], 0.9);
  EXPECT_NEAR(snapshot().reference_velocity.norm(), 0, 1e-9);
  ticks(300);
  EXPECT_TRUE(near(snapshot().reference_position, there, 1e-9));
  arm->setpoint.joint_position = start;
  arm->setpoint.joint_position[0] -= 1;
  ticks(300);
  ASSERT_GT(snapshot().reference_velocity.norm(), 0.1);
  arm->fresh = false;
  ticks(501);  // now it is stale
  ASSERT_EQ(snapshot().status, Status::kSetpointStale);
  ticks(600);
  EXPECT_EQ(snapshot().reference_velocity.norm(), 0);
  EXPECT_GT((snapshot().reference_position - arm->setpoint.joint_position).norm(), 0.1);
}

}  // namespace
}  // namespace dashpot::controller
