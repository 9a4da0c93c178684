// Set-points, gains and modes change in closed loop with a simulated arm: no torque jumps, the
// limits of rate never have to act, and the robot arrives.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace dashpot::controller {
namespace {

using testing::near;
using testing::SimulatedArm;

struct Extremes {
  double rate_share = 0;  ///< largest change of the law's torque as a share of the rate limit
  Status worst = Status::kOk;
};

/// Runs the loop and watches the torque that the law asks for, before any limit.
Extremes run(SimulatedArm& arm, double seconds) {
  const Settings& settings = arm.controller.settings();
  const JointVector largest_step = settings.limits.torque_rate * settings.period;
  Extremes extremes;
  JointVector last;
  for (int k = 0; k < static_cast<int>(seconds / settings.period); ++k) {
    extremes.worst = worse(extremes.worst, arm.step());
    const JointVector& now = arm.controller.snapshot().law_torque;
    if (last.size() > 0) {
      extremes.rate_share = std::max(
          extremes.rate_share, (now - last).cwiseAbs().cwiseQuotient(largest_step).maxCoeff());
    }
    last = now;
  }
  return extremes;
}

class MovingArm : public ::testing::Test {
 protected:
  MovingArm()
      : model(testing::arm_model(testing::arms()[0])),
        arm(model, testing::quiet_settings(model), testing::panda_ready()) {}

  void start(Mode mode) {
    arm.setpoint.mode = mode;
    const Extremes extremes = run(arm, 1.0);
    EXPECT_EQ(extremes.worst, Status::kOk) << to_text(extremes.worst);
    EXPECT_LT(extremes.rate_share, 0.5);
  }
  void expect_smooth(double seconds) {
    const Extremes extremes = run(arm, seconds);
    EXPECT_EQ(extremes.worst, Status::kOk) << to_text(extremes.worst);
    EXPECT_LT(extremes.rate_share, 0.5);
  }

  /// The world begins to pull, smoothly.
  void load(const Vector6& wrench) {
    for (int k = 1; k <= 1000; ++k) {
      const double s = 1e-3 * k;
      arm.state.external_wrench = s * s * (3 - 2 * s) * wrench;
      arm.step();
    }
  }

  RobotModel model;
  SimulatedArm arm;
};

const Vector6 kLoad{30, -20, 25, 1, 2, -1};  // N, N m

TEST_F(MovingArm, HoldsStillWhereItStarts) {
  start(Mode::kJoint);
  EXPECT_TRUE(near(arm.state.position, testing::panda_ready(), 1e-6));
  EXPECT_EQ(arm.controller.snapshot().restarts, 1u);
}

TEST_F(MovingArm, JointStepArrives) {
  start(Mode::kJoint);
  arm.setpoint.joint_position[0] += 1.0;
  arm.setpoint.joint_position[3] += 0.5;
  expect_smooth(6.0);
  EXPECT_TRUE(near(arm.state.position, arm.setpoint.joint_position, 1e-3));
  EXPECT_EQ(arm.controller.snapshot().reference_position, arm.setpoint.joint_position);
}

TEST_F(MovingArm, PoseStepArrives) {
  start(Mode::kCartesian);
  arm.setpoint.tip_pose.position += Eigen::Vector3d(0.1, 0.2, -0.15);
  arm.setpoint.tip_pose.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()) *
                                   arm.setpoint.tip_pose.rotation;
  expect_smooth(6.0);
  EXPECT_TRUE(near(arm.tip().position, arm.setpoint.tip_pose.position, 2e-3));
  EXPECT_TRUE(near(arm.tip().rotation, arm.setpoint.tip_pose.rotation, 1e-2));
  EXPECT_EQ(arm.controller.snapshot().reference_tip.position, arm.setpoint.tip_pose.position);
}

TEST_F(MovingArm, AWrenchIsExertedAgainstAWall) {
  start(Mode::kCartesian);
  arm.setpoint.wrench << 0, 0, -20, 0, 0, 0;
  load(Vector6{0, 0, 20, 0, 0, 0});
  expect_smooth(6.0);
  EXPECT_TRUE(near(arm.controller.snapshot().tip_wrench, arm.setpoint.wrench, 0.05));
  EXPECT_TRUE(near(arm.tip().position, arm.setpoint.tip_pose.position, 1e-3));
}

TEST_F(MovingArm, GainStepUnderLoadIsSmooth) {
  start(Mode::kCartesian);
  load(kLoad);
  run(arm, 2.0);
  arm.setpoint.gains.task_stiffness *= 3;
  arm.setpoint.gains.task_damping *= 2;
  expect_smooth(6.0);
  const Vector6 sag = arm.controller.snapshot().tip_error;
  EXPECT_TRUE(near(arm.setpoint.gains.task_stiffness * sag, -kLoad, 0.05));
}

TEST_F(MovingArm, ModeSwitchesUnderLoadAreSmooth) {
  start(Mode::kJoint);
  load(0.5 * kLoad);
  for (const Mode mode : {Mode::kCartesian, Mode::kJoint, Mode::kCartesian}) {
    arm.setpoint.mode = mode;
    arm.setpoint.joint_position = arm.state.position;
    arm.setpoint.tip_pose = arm.tip();
    expect_smooth(2.0);
    EXPECT_EQ(arm.controller.snapshot().joint_weight, mode == Mode::kJoint ? 1 : 0);
    EXPECT_EQ(arm.controller.snapshot().task_weight, mode == Mode::kCartesian ? 1 : 0);
  }
}

TEST_F(MovingArm, TargetsMayChangeInTheMiddleOfABlend) {
  start(Mode::kJoint);
  for (int k = 0; k < 12; ++k) {
    arm.setpoint.mode = k % 2 == 0 ? Mode::kCartesian : Mode::kJoint;
    arm.setpoint.gains.frame = k % 4 < 2 ? Frame::kBase : Frame::kTool;
    arm.setpoint.gains.directions[2] = k % 3 != 0;
    arm.setpoint.tip_pose.position.y() += k % 3 == 0 ? 0.1 : -0.05;
    arm.setpoint.joint_position[1] += k % 2 == 0 ? 0.1 : -0.1;
    expect_smooth(0.17);
  }
}

TEST_F(MovingArm, FreeDirectionsGiveWay) {
  start(Mode::kCartesian);
  arm.setpoint.gains.directions = {true, true, false, true, true, true};
  run(arm, 1.0);
  const Pose before = arm.tip();
  load(Vector6{0, 0, 5, 0, 0, 0});
  EXPECT_GT(arm.tip().position.z() - before.position.z(), 0.01);
  EXPECT_LT((arm.tip().position - before.position).head<2>().norm(), 0.005);
}

TEST_F(MovingArm, PullsBackTheWayItCameBeyondHalfATurn) {
  Settings settings = arm.controller.settings();
  settings.limits.beyond_model = true;
  settings.limits.angular_error = 10;
  arm = SimulatedArm(model, settings, testing::panda_ready());
  start(Mode::kCartesian);
  // The goal turns past pi about z while the arm is kept from following.
  Snapshot last = arm.controller.snapshot();
  for (int k = 0; k < 6000; ++k) {
    const double angle = std::min(3.6, 1e-3 * k);
    arm.setpoint.tip_pose.rotation =
        Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) * last.tip.rotation;
    arm.setpoint.time = arm.state.time;
    arm.controller.update(arm.state, arm.setpoint, arm.torque);
    arm.state.time += 1'000'000;
    const Snapshot& now = arm.controller.snapshot();
    EXPECT_LT((now.tip_error - last.tip_error).norm(), 0.01);
    last.tip_error = now.tip_error;
  }
  EXPECT_NEAR(last.tip_error[5], 3.6, 1e-6);
}

TEST(MotionOfEveryArm, HoldsItsPoseUnderSmallLoads) {
  for (const testing::Arm& which : testing::arms()) {
    SCOPED_TRACE(which.file);
    const RobotModel model = testing::arm_model(which);
    Settings settings = testing::quiet_settings(model);
    JointVector q = settings.initial.joint_position;
    for (Eigen::Index i = 0; i < q.size(); ++i) q[i] += 0.3 + 0.1 * static_cast<double>(i % 3);
    SimulatedArm arm(model, settings, q);
    arm.setpoint.mode = Mode::kCartesian;
    const Extremes extremes = run(arm, 2.0);
    EXPECT_EQ(extremes.worst, Status::kOk) << to_text(extremes.worst);
    EXPECT_LT(extremes.rate_share, 0.5);
    EXPECT_TRUE(near(arm.tip().position, arm.setpoint.tip_pose.position, 1e-5));
  }
}

// Limits of the tip's speed that are lowered while the loop runs.

TEST(TipSpeed, IsOnlyEverLowered) {
  testing::SimulatedArm arm(
      testing::panda_model(),
      [] {
        Settings settings = testing::quiet_settings(testing::panda_model());
        settings.initial.mode = Mode::kCartesian;
        return settings;
      }(),
      testing::panda_ready());
  const auto fastest = [&](const TipSpeed& speed, double way) {
    arm.controller.limit_tip_speed(speed);
    arm.setpoint.tip_pose.position.y() += way;
    double found = 0;
    for (int k = 0; k < 1500; ++k) {
      EXPECT_LT(arm.step(), Status::kSetpointStale);
      found = std::max(found, arm.controller.snapshot().reference_twist.head<3>().norm());
    }
    return found;
  };
  const double all = arm.controller.settings().motion.linear_velocity;
  EXPECT_NEAR(fastest({}, 0.3), all, 1e-3 * all);
  EXPECT_NEAR(fastest({.linear = 0.1}, -0.1), 0.1, 1e-4);
  EXPECT_NEAR(fastest({.limit = 0.2}, -0.15), 0.12, 1e-4);
  EXPECT_NEAR(fastest({.linear = 10 * all}, 0.3), all, 1e-3 * all);
  arm.controller.limit_tip_speed({.limit = 0.05});
  for (int k = 0; k < 100; ++k) arm.step();
  arm.state.velocity[0] = 0.5;  // a blow: the tip is faster than allowed
  arm.step();
  EXPECT_EQ(arm.controller.snapshot().fault, Status::kTipSpeedLimit);
}

/// The reference of the joint mode is as slow as the tip's, on the way and while it changes.
TEST(TipSpeed, SlowsTheJointModeToo) {
  DASHPOT_SKIP_IF_QUICK();
  Settings settings = testing::quiet_settings(testing::panda_model());
  settings.initial.mode = Mode::kJoint;
  testing::SimulatedArm arm(testing::panda_model(), settings, testing::panda_ready());
  const auto fastest = [&](const TipSpeed& speed, double way, int ticks, bool angular = false) {
    arm.controller.limit_tip_speed(speed);
    arm.setpoint.joint_position[0] += way;
    arm.setpoint.joint_position[3] += 0.5 * way;
    double found = 0;
    for (int k = 0; k < ticks; ++k) {
      EXPECT_LT(arm.step(), Status::kSetpointStale);
      const JointVector& q = arm.controller.snapshot().reference_position;
      const JointVector& qd = arm.controller.snapshot().reference_velocity;
      const Vector6 V = evaluate(arm.model, q, qd).J * qd;
      found = std::max(found, angular ? V.tail<3>().norm() : V.head<3>().norm());
    }
    EXPECT_EQ(arm.controller.snapshot().reference_position, arm.setpoint.joint_position);
    return found;
  };
  EXPECT_GT(fastest({}, 0.8, 3000), 0.2);
  EXPECT_NEAR(fastest({.linear = 0.1}, -0.8, 9000), 0.1, 0.002);
  EXPECT_NEAR(fastest({.limit = 0.1}, 0.4, 9000), 0.06, 0.002);
  EXPECT_NEAR(fastest({.angular = 0.1}, -0.4, 9000, true), 0.1, 0.002);
  EXPECT_GT(fastest({}, -0.8, 3000), 0.2);
  // A limit that comes on the way is reached as the acceleration allows.
  arm.setpoint.joint_position[0] += 0.8;
  for (int k = 0; k < 700; ++k) arm.step();
  arm.controller.limit_tip_speed({.linear = 0.05});
  const JointVector most = 1e-3 * settings.motion.acceleration;
  JointVector last = arm.controller.snapshot().reference_velocity;
  EXPECT_GT(last[0], 0.3);
  for (int k = 0; k < 1000; ++k) {
    arm.step();
    const JointVector& now = arm.controller.snapshot().reference_velocity;
    EXPECT_LE((now - last).cwiseAbs().cwiseQuotient(most).maxCoeff(), 1 + 1e-9);
    last = now;
  }
  const JointVector& q = arm.controller.snapshot().reference_position;
  const Vector6 V = evaluate(arm.model, q, last).J * last;
  EXPECT_NEAR(V.head<3>().norm(), 0.05, 0.001);
}

}  // namespace
}  // namespace dashpot::controller
