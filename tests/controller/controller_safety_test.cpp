// Limits of the robot: torque, velocity and position, and their safe outputs.
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/safety.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <vector>

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

TEST_F(Safety, ResetGoesOnFromTheLastTorque) {
  run(1.0);
  arm->state.velocity[3] = 0.3;  // in motion
  next();
  const JointVector before = arm->torque;
  arm->controller.reset();
  EXPECT_EQ(snapshot().tick, 0u);
  next();
  const JointVector step = settings.limits.torque_rate * settings.period;
  EXPECT_LE(((arm->torque - before).cwiseAbs() - step).maxCoeff(), 1e-12);
  arm->state.velocity[3] = 0;
  arm->controller.reset(gravity());
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-9));
}

TEST_F(Safety, AControllerThatIsToldNothingStartsFromTheWeight) {
  Controller controller(model, settings);
  EXPECT_EQ(controller.update(arm->state, arm->setpoint, arm->torque), Status::kOk);
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-9));
}

TEST_F(Safety, TorqueLimitClamps) {
  settings.limits.torque[1] = 2;  // less than the arm weighs
  make();
  EXPECT_EQ(arm->step(), Status::kWeightNotHeld);
  EXPECT_EQ(std::abs(arm->torque[1]), 2.0);
  EXPECT_GT(std::abs(snapshot().law_torque[1]), 3.0);
}

TEST_F(Safety, OutsideAPositionLimitReturnsSlowlyAndWaitsForItsRelease) {
  JointVector q = testing::panda_ready();
  const double lower = settings.limits.position_lower[3];
  q[3] = lower - 0.02;
  arm = std::make_unique<SimulatedArm>(model, settings, q);
  arm->setpoint.joint_position = testing::panda_ready();
  EXPECT_EQ(arm->step(), Status::kPositionLimit);
  EXPECT_EQ(snapshot().fault, Status::kPositionLimit);
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-2));  // from almost zero
  double fastest = 0;
  for (int k = 0; k < 4000; ++k) {
    arm->step();
    fastest = std::max(fastest, arm->state.velocity.cwiseAbs().maxCoeff());
    EXPECT_EQ(snapshot().joint_weight, 0);
    if (k > 2000) {
      EXPECT_EQ(snapshot().status, Status::kFaultLatched);
    }
  }
  EXPECT_LE(fastest, 0.03 * settings.limits.velocity[3]);
  EXPECT_GT(arm->state.position[3], lower);
  arm->controller.release();
  arm->step();
  EXPECT_EQ(snapshot().fault, Status::kOk);
}

/// A joint that is too fast first, and then outside its limit, comes back as well.
TEST_F(Safety, OutsideAPositionLimitReturnsWhateverLatchedFirst) {
  JointVector q = testing::panda_ready();
  const double lower = settings.limits.position_lower[3];
  q[3] = lower + 0.01;
  arm = std::make_unique<SimulatedArm>(model, settings, q);
  arm->state.velocity[3] = -1.1 * settings.limits.velocity[3];
  EXPECT_EQ(arm->step(), Status::kVelocityLimit);
  for (int k = 0; k < 500; ++k) arm->step();
  EXPECT_LT(arm->state.position[3], lower);
  for (int k = 0; k < 4000; ++k) arm->step();
  EXPECT_EQ(snapshot().fault, Status::kVelocityLimit);
  EXPECT_GT(arm->state.position[3], lower);
}

// A person throws the arm about: a high speed does not count as a broken sensor, and the arm is
// damped.
TEST_F(Safety, AFastRobotIsDampedHoweverFast) {
  settings.limits.beyond_model = true;
  settings.limits.tip_velocity = 100;
  settings.limits.velocity.setConstant(3);
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
    const Status status = next();
    ASSERT_EQ(status == Status::kVelocityLimit, speed > 3) << "tick " << k;
  }
  const JointVector held = arm->torque - gravity();
  EXPECT_LT(held[5], -1);  // braked, and held up
}

/// A hard push is physics, whether its position comes along at once or a tick later.
TEST_F(Safety, ABlowIsNoBrokenSensor) {
  for (const double at_once : {1.0, 0.5, 0.0}) {
    make();
    run(1.0);
    double v = 0;
    arm->state.time -= 1'000'000;  // the time of the last tick
    for (int k = 0; k < 3; ++k) {
      const double last = v;
      v += 1.4;  // 1400 rad/s^2
      arm->state.position[6] += 0.001 * ((1 - at_once) * last + at_once * v);
      arm->state.velocity[6] = v;
      const Status status = next();
      EXPECT_TRUE(status != Status::kStateJump || at_once == 0) << at_once;
    }
    for (int k = 0; k < 3; ++k) {
      arm->state.position[6] += 0.001 * v;
      next();
    }
    EXPECT_EQ(snapshot().status, Status::kVelocityLimit);  // 4.2 rad/s
    EXPECT_NEAR(arm->torque[1], gravity()[1], 0.1 * std::abs(gravity()[1]));
  }
}

/// After a pause in which a person moved the arm it stays where it was put, released or not.
TEST_F(Safety, DoesNotDriveBackUnasked) {
  run(1.0);
  arm->state.time += 10'000'000'000;
  arm->state.position[3] += 0.4;
  arm->fresh = false;  // there is no new set-point
  const JointVector put = arm->state.position;
  for (int k = 0; k < 3000; ++k) {
    if (k == 1500) arm->controller.release();
    arm->setpoint.time = arm->state.time - 10'500'000'000;
    arm->step();
  }
  EXPECT_TRUE(near(arm->state.position, put, 3e-3));
}

TEST_F(Safety, AReleaseForgetsTheCommandedWrench) {
  settings.initial.mode = Mode::kCartesian;
  settings.watchdog.feedback = 0;  // something keeps the robot where it is
  settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
  make();
  run(1.0);
  arm->setpoint.wrench[1] = 5;
  for (int k = 0; k < 1000; ++k) next();
  EXPECT_NEAR(snapshot().tip_wrench[1], 5, 0.1);
  arm->state.time += 1'000'000'000;
  EXPECT_EQ(tick(), Status::kTimeGap);
  arm->controller.release();
  for (int k = 0; k < 1000; ++k) {  // without a set-point
    arm->state.time += 1'000'000;
    EXPECT_LT(arm->controller.update(arm->state, arm->torque), Status::kSetpointRejected);
    EXPECT_LT(snapshot().tip_wrench.norm(), 0.1);
  }
}

/// With isotropic springs the frame of the gains makes no difference, also while springs grow.
TEST_F(Safety, SpringsGrowAlikeInBothFrames) {
  std::vector<JointVector> in_base;
  for (const Frame frame : {Frame::kBase, Frame::kTool}) {
    settings.initial.mode = Mode::kCartesian;
    settings.watchdog.feedback = 0;
    Gains& gains = settings.initial.gains;
    gains.frame = frame;
    gains.task_stiffness = Vector6(400, 400, 400, 30, 30, 30).asDiagonal();
    gains.task_damping = Vector6(20, 20, 20, 2, 2, 2).asDiagonal();
    gains.null_stiffness.setConstant(7, 20);
    make();
    next();
    arm->state.position[0] += 5e-4;
    arm->state.position[3] -= 5e-4;
    for (std::size_t k = 0; k < 300; ++k) {
      EXPECT_LT(next(), Status::kSetpointRejected);
      if (frame == Frame::kBase) {
        in_base.push_back(arm->torque);
      } else {
        EXPECT_TRUE(near(arm->torque, in_base[k], 1e-9)) << k;
      }
    }
  }
  EXPECT_GT((in_base.back() - gravity()).norm(), 0.05);
}

TEST_F(Safety, ARestReleasesWhereItIsWanted) {
  settings.watchdog.release_after = 0.5;
  make();
  run(1.0);
  arm->state.velocity[4] = 1.2 * settings.limits.velocity[4];
  for (int k = 0; k < 3; ++k) {
    arm->state.position[4] += 1e-3 * arm->state.velocity[4];
    next();
  }
  EXPECT_EQ(snapshot().fault, Status::kVelocityLimit);
  arm->state.velocity[4] = 0.05 * settings.limits.velocity[4];  // no rest
  for (int k = 0; k < 1000; ++k) {
    arm->state.position[4] += 1e-3 * arm->state.velocity[4];
    EXPECT_EQ(next(), Status::kFaultLatched);
  }
  arm->state.velocity[4] = 0;
  int ticks = 0;
  while (next() == Status::kFaultLatched && ticks < 1000) ++ticks;
  EXPECT_NEAR(ticks, 500, 2);
  EXPECT_EQ(snapshot().fault, Status::kOk);
}

TEST_F(Safety, TooFastDampsUntilReleased) {
  run(1.0);
  const double limit = settings.limits.velocity[4];
  const auto move = [&](double v) {
    arm->state.velocity[4] = v;
    arm->state.position[4] += 1e-3 * v;
    return next();
  };
  for (double v = 0; v < limit; v += 0.1) EXPECT_NE(move(v), Status::kVelocityLimit);
  EXPECT_NE(move(limit), Status::kVelocityLimit);
  EXPECT_EQ(move(1.001 * limit), Status::kVelocityLimit);
  EXPECT_EQ(snapshot().fault, Status::kVelocityLimit);
  for (int k = 0; k < 50; ++k) move(1.001 * limit);  // what goes on for longer is held against
  const auto there = evaluate(model, arm->state.position, arm->state.velocity);
  const JointVector braked = gravity() - there.M * arm->state.velocity / 0.05;
  EXPECT_TRUE(near(arm->torque, braked, 1e-9));
  EXPECT_EQ(move(0.9 * limit), Status::kFaultLatched);
  EXPECT_EQ(move(0), Status::kFaultLatched);
  arm->controller.release();
  EXPECT_LT(move(0), Status::kSetpointRejected);
  EXPECT_EQ(snapshot().restarts, 2u);
}

TEST_F(Safety, ALawThatOverflowsDropsNothing) {
  settings.initial.gains.joint_damping.setIdentity(7, 7);
  settings.limits.beyond_model = true;
  settings.limits.velocity.setConstant(1e308);
  settings.limits.tip_velocity = 1e308;
  make();
  arm->setpoint.gains = settings.initial.gains;
  run(1.0);
  const JointVector before = arm->torque;
  arm->state.velocity[0] = 1e200;  // Coriolis torque overflows
  EXPECT_EQ(next(), Status::kNotFinite);
  const double step = settings.limits.torque_rate[0] * settings.period;  // of the brake
  EXPECT_TRUE(near(arm->torque, before, step + 1e-9));
  arm->state.velocity[0] = 0;
  EXPECT_EQ(next(), Status::kOk);
}

TEST_F(Safety, GravityIsLeftToTheRobotWhereItCompensatesItself) {
  settings.feed_forward.gravity = false;
  make();
  arm->controller.reset(JointVector::Zero(7));
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
    arm->state.time += k == 1 ? 50'000'000 : 1'000'000;
    arm->setpoint.time = arm->state.time;
    ASSERT_EQ(tick(), k == 1 ? Status::kTimeGap : Status::kFaultLatched);
    EXPECT_TRUE(near(arm->torque - gravity(), (1 - k / slowest) * pull, 1e-6)) << k;
  }
  for (int k = 0; k < 2; ++k) next();
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-9));
}

}  // namespace
}  // namespace dashpot::controller
