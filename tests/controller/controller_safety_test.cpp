// What the robot itself may not do: limits of torque, velocity and position, and their safe
// outputs.
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/safety.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

namespace dashpot::controller {
namespace {

using testing::near;
using testing::Safety;
using testing::SimulatedArm;

TEST(StatusText, IsOneForEachStatus) {
  std::set<std::string> texts;
  for (int i = 0; i <= static_cast<int>(Status::kNotFinite); ++i) {
    const std::string text = to_text(static_cast<Status>(i));
    EXPECT_FALSE(text.empty());
    EXPECT_NE(text, "unknown status");
    texts.insert(text);
  }
  EXPECT_EQ(texts.size(), static_cast<std::size_t>(Status::kNotFinite) + 1);
  EXPECT_EQ(worse(Status::kOk, Status::kTimeGap), Status::kTimeGap);
}

TEST_F(Safety, ResetStartsLikeTheFirstTick) {
  run(1.0);
  arm->controller.reset();
  EXPECT_EQ(snapshot().tick, 0u);
  const JointVector step = settings.limits.torque_rate * settings.period;
  EXPECT_EQ(next(), Status::kTorqueLimited);  // from zero, while gravity pulls
  EXPECT_LE((arm->torque.cwiseAbs() - step).maxCoeff(), 1e-12);
  arm->controller.reset(gravity());
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-9));
}

TEST_F(Safety, TorqueLimitClamps) {
  settings.limits.torque[1] = 2;  // less than the arm weighs
  make();
  EXPECT_EQ(arm->step(), Status::kTorqueLimited);
  EXPECT_EQ(std::abs(arm->torque[1]), 2.0);
  EXPECT_GT(std::abs(snapshot().law_torque[1]), 3.0);
}

TEST_F(Safety, TorqueRateLimitClampsEveryTick) {
  settings.limits.torque_rate *= 1e-2;
  make();
  run(1.0);
  arm->state.velocity[3] = 0.5;  // a push: the damper wants a jump
  JointVector last = arm->torque;
  EXPECT_EQ(next(), Status::kTorqueLimited);
  EXPECT_LE(
      ((arm->torque - last).cwiseAbs() - settings.limits.torque_rate * settings.period).maxCoeff(),
      1e-12);
}

TEST_F(Safety, NearAJointLimitIsPushedBackSmoothly) {
  settings.feed_forward = FeedForward{false, false, false, false, false};
  settings.initial.gains.joint_stiffness.setZero();
  settings.initial.gains.joint_damping.setZero();
  settings.limits.torque_rate.setConstant(1e6);
  make();
  const double upper = settings.limits.position_upper[0];
  const double margin = settings.limits.position_margin, most = settings.limits.torque[0];
  double last = 0;
  for (double q = upper - 2 * margin; q < upper + 0.05; q += 0.001) {
    arm->state.position[0] = q;
    const Status status = next();
    const double x = std::max(0.0, (margin - (upper - q)) / margin);
    EXPECT_NEAR(arm->torque[0], -std::min(1.0, 0.5 * x * x) * most, 1e-9);
    EXPECT_EQ(status, q > upper            ? Status::kPositionLimit
                      : q > upper - margin ? Status::kNearJointLimit
                                           : Status::kOk)
        << to_text(status);
    EXPECT_LT(std::abs(arm->torque[0] - last), 3.0);
    last = arm->torque[0];
  }
  // On the way in a damper helps, on the way out it does not.
  arm->controller.reset();
  arm->state.position[0] = upper - 0.5 * margin;
  next();
  arm->state.velocity[0] = 1.0;
  next();
  EXPECT_NEAR(arm->torque[0], -0.5 * most * (0.25 + 0.5 / settings.limits.velocity[0]), 1e-9);
  arm->state.velocity[0] = -0.05;
  next();
  EXPECT_NEAR(arm->torque[0], -0.5 * most * 0.25, 1e-9);
}

TEST_F(Safety, OutsideAPositionLimitDampsAndPushesBack) {
  run(0.5);
  JointVector q = testing::panda_ready();
  q[3] = settings.limits.position_lower[3] - 0.02;
  arm = std::make_unique<SimulatedArm>(model, settings, q);
  arm->setpoint.joint_position = testing::panda_ready();
  EXPECT_EQ(arm->step(), Status::kPositionLimit);
  for (int k = 0; k < 2000 && arm->step() == Status::kPositionLimit; ++k) {
    EXPECT_EQ(snapshot().joint_weight, 0);
  }
  EXPECT_GT(arm->state.position[3], settings.limits.position_lower[3]);
  for (int k = 0; k < 9000; ++k) arm->step();  // recovers, and goes where it was told
  EXPECT_EQ(snapshot().status, Status::kOk);
  EXPECT_TRUE(near(arm->state.position, testing::panda_ready(), 1e-2));
}

// Thrown about by somebody: too fast is no broken sensor, and an arm that falls is damped.
TEST_F(Safety, AFastRobotIsDampedHoweverFast) {
  settings.limits.velocity.setConstant(0.3);
  settings.limits.position_lower.setConstant(-100);
  settings.limits.position_upper.setConstant(100);
  make();
  run(1.0);
  double speed = 0;
  for (int k = 0; k < 3000; ++k) {
    const double last = speed;
    speed = std::min(5.0, speed + 0.1);
    arm->state.position[5] += 0.001 * 0.5 * (last + speed);
    arm->state.velocity[5] = speed;
    ASSERT_EQ(next(), speed > 0.3 ? Status::kVelocityLimit : Status::kOk) << "tick " << k;
  }
  const JointVector held = arm->torque - gravity();
  EXPECT_LT(held[5], -1);  // damped, and held up
  EXPECT_NEAR(held[1], 0, 1e-6);
}

TEST_F(Safety, ABlowIsRampedForAMomentAndThenDamped) {
  run(1.0);
  arm->state.velocity[5] = 20;  // from one tick to the next
  int ramped = 0;
  for (int k = 0; k < 200; ++k) {
    arm->state.position[5] += 0.001 * 20;
    const Status status = next();
    if (status == Status::kStateJump) ++ramped;
    EXPECT_TRUE(status == Status::kStateJump || status >= Status::kVelocityLimit);
  }
  EXPECT_GE(ramped, 20);
  EXPECT_LE(ramped, 25);
}

TEST_F(Safety, AGapDampsForOneTickAndStartsAfresh) {
  run(1.0);
  arm->state.time += 50'000'000;
  arm->setpoint.time = arm->state.time;
  EXPECT_EQ(tick(), Status::kTimeGap);
  EXPECT_EQ(snapshot().joint_weight, 0);
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-6));
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_EQ(snapshot().restarts, 2u);
}

TEST_F(Safety, TooFastDampsUntilSlow) {
  run(1.0);
  const double limit = settings.limits.velocity[4];
  for (double v = 0; v < 1.05 * limit; v += 0.1) {
    arm->state.velocity[4] = v;
    next();
  }
  arm->state.velocity[4] = 1.05 * limit;
  EXPECT_EQ(next(), Status::kVelocityLimit);
  for (int k = 0; k < 200; ++k) next();
  const JointVector damped = gravity() - settings.limits.damping.cwiseProduct(arm->state.velocity);
  EXPECT_TRUE(near(arm->torque, damped, 1e-9));
  arm->state.velocity[4] = 0.9 * limit;
  EXPECT_EQ(next(), Status::kVelocityLimit);
  arm->state.velocity[4] = 0.7 * limit;
  EXPECT_LT(next(), Status::kSetpointRejected);
  EXPECT_EQ(snapshot().restarts, 2u);
}

TEST_F(Safety, ALawThatOverflowsRampsDown) {
  settings.initial.gains.joint_damping.setIdentity(7, 7);
  settings.limits.velocity.setConstant(1e308);
  settings.limits.damping.setConstant(1e10);
  make();
  arm->setpoint.gains = settings.initial.gains;
  run(1.0);
  const JointVector before = arm->torque;
  arm->state.velocity[0] = 1e200;  // Coriolis torque overflows
  EXPECT_EQ(next(), Status::kNotFinite);
  EXPECT_TRUE(near(arm->torque, 0.99 * before, 1e-9));
  arm->state.velocity[0] = 0;
  EXPECT_EQ(next(), Status::kOk);
}

TEST_F(Safety, GravityIsLeftToTheRobotWhereItCompensatesItself) {
  settings.feed_forward.gravity = false;
  make();
  arm->controller.reset();
  for (int k = 0; k < 100; ++k) EXPECT_EQ(next(), Status::kOk);
  EXPECT_TRUE(near(arm->torque, JointVector(JointVector::Zero(7)), 1e-9));
  arm->setpoint.time -= 10'000'000'000;
  arm->fresh = false;
  EXPECT_EQ(next(), Status::kSetpointLost);
  EXPECT_TRUE(near(arm->torque, JointVector(JointVector::Zero(7)), 1e-9));
}

TEST_F(Safety, SpringsLetGoInAllJointsAlike) {
  run(1.0);
  for (int i = 0; i < 7; ++i) arm->setpoint.joint_position[i] += 0.3;  // the robot is kept from it
  for (int k = 0; k < 1500; ++k) next();
  const JointVector pull = arm->torque - gravity();
  ASSERT_GT(pull.cwiseAbs().minCoeff(), 0.02);
  ASSERT_GT(pull.cwiseAbs().maxCoeff(), 5);
  const double slowest = pull.cwiseAbs().maxCoeff() / (settings.limits.torque_rate[0] * 1e-3);
  for (int k = 1; k < static_cast<int>(slowest); ++k) {
    arm->state.time += 50'000'000;
    arm->setpoint.time = arm->state.time;
    ASSERT_EQ(tick(), Status::kTimeGap);
    EXPECT_TRUE(near(arm->torque - gravity(), (1 - k / slowest) * pull, 1e-6)) << k;
  }
  for (int k = 0; k < 2; ++k) {
    arm->state.time += 50'000'000;
    EXPECT_EQ(tick(), Status::kTimeGap);
  }
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-9));
}

}  // namespace
}  // namespace dashpot::controller
