// Set-points and springs from a start on: after a reset, after a fault, between
// modes.
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/safety.hpp>

#include <gtest/gtest.h>

#include <algorithm>

namespace dashpot::controller {
namespace {

using testing::near;

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
