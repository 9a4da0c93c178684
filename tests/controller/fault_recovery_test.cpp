// How the controller recovers from bad states, from faults, and from old set-points.
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/safety.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace dashpot::controller {
namespace {

using testing::near;

class Recovery : public testing::Safety {
 protected:
  /// A tick with a NaN position, `milliseconds` after the last.
  Status bad(int milliseconds = 1) {
    const JointVector position = arm->state.position;
    arm->state.position[2] = std::nan("");
    arm->state.time += 1'000'000 * (milliseconds - 1);
    const Status status = next();
    arm->state.position = position;
    return status;
  }
  /// A pause that latches.
  void pause() {
    arm->state.time += 50'000'000;
    EXPECT_EQ(next(), Status::kTimeGap);
  }
};

/// The torque after bad states is the acting one, although there has been no torque before.
TEST_F(Recovery, StartsFromZeroAfterBadStates) {
  arm->controller = Controller(model, settings);
  EXPECT_EQ(bad(), Status::kStateNotFinite);
  EXPECT_EQ(arm->torque, JointVector(JointVector::Zero(7)));
  const double most = gravity().cwiseAbs().maxCoeff();
  ASSERT_GT(most, 10);
  for (int k = 1; k < static_cast<int>(most); ++k) {  // 1 N m each
    EXPECT_EQ(next(), Status::kTorqueLimited);
    EXPECT_TRUE(near(arm->torque, k / most * gravity(), 1e-9)) << k;
  }
  for (int k = 0; k < 3; ++k) next();
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-9));
}

/// An outage lasts from the last good state, however few states came meanwhile.
TEST_F(Recovery, LatchesAfterTheLongestGapWithoutAGoodState) {
  run(1.0);
  next();
  bad(5);
  bad(4);
  EXPECT_LT(next(), Status::kFaultLatched);  // 10 ms
  EXPECT_EQ(snapshot().restarts, 1u);
  bad(5);
  bad(5);
  EXPECT_EQ(snapshot().fault, Status::kOk);
  bad(1);
  EXPECT_EQ(snapshot().fault, Status::kStateNotFinite);
  EXPECT_EQ(next(), Status::kFaultLatched);
}

/// Outages are not added up.
TEST_F(Recovery, GoesOnBetweenShortOutages) {
  run(1.0);
  next();
  for (int k = 0; k < 5; ++k) {
    for (int tick = 0; tick < 9; ++tick) EXPECT_EQ(bad(), Status::kStateNotFinite);
    EXPECT_LT(next(), Status::kFaultLatched);
  }
  EXPECT_EQ(snapshot().restarts, 1u);
}

/// While an arm is stopped its torque comes back after a ramp in all joints alike.
TEST_F(Recovery, FadesEvenlyAfterARamp) {
  run(1.0);
  pause();
  for (int k = 0; k < 100; ++k) next();
  ASSERT_TRUE(near(arm->torque, gravity(), 1e-6));
  const JointVector weight = gravity();
  for (int k = 0; k < 2060; ++k) bad();
  ASSERT_TRUE(near(arm->torque, 0.4 * weight, 1e-6));
  const double ticks = 0.6 * weight.cwiseAbs().maxCoeff();  // of 1 N m each
  ASSERT_GT(ticks, 5);
  for (int k = 1; k < static_cast<int>(ticks); ++k) {
    next();
    EXPECT_TRUE(near(arm->torque, (0.4 + 0.6 * k / ticks) * weight, 1e-6)) << k;
  }
  // And another ramp takes as long as the first.
  for (int k = 0; k < 30; ++k) next();
  for (int k = 0; k < 2050; ++k) bad();
  EXPECT_TRUE(near(arm->torque, 0.5 * weight, 1e-6));
}

/// A robot at rest after a fault must be watched.
TEST_F(Recovery, RestsAnewAfterABadState) {
  settings.watchdog.release_after = 0.3;
  make();
  run(1.0);
  const auto ticks_to_release = [&] {
    int ticks = 1;
    while (next() >= Status::kFaultLatched && ticks < 2000) ++ticks;
    return ticks;
  };
  pause();
  EXPECT_NEAR(ticks_to_release(), 300, 1);
  pause();
  for (int k = 0; k < 250; ++k) EXPECT_EQ(next(), Status::kFaultLatched);
  bad();
  EXPECT_NEAR(ticks_to_release(), 300, 2);
  pause();
  for (int k = 0; k < 250; ++k) next();
  arm->state.velocity[4] = 0.011 * settings.limits.velocity[4];
  next();
  arm->state.velocity[4] = 0.009 * settings.limits.velocity[4];  // is rest
  EXPECT_NEAR(ticks_to_release(), 300, 1);
  pause();
  for (int k = 0; k < 250; ++k) next();
  pause();  // another fault while the first is there
  EXPECT_NEAR(ticks_to_release(), 300, 1);
}

/// The rest after one fault does not count for the next.
TEST_F(Recovery, RestsAnewAfterEachLawThatOverflows) {
  settings.watchdog.release_after = 0.3;
  settings.limits.beyond_model = true;
  settings.limits.velocity.setConstant(1e308);
  settings.limits.tip_velocity = 1e308;
  make();
  arm->setpoint.gains = settings.initial.gains;
  run(1.0);
  for (int k = 0; k < 2; ++k) {
    arm->state.velocity[0] = 1e200;  // Coriolis torque overflows
    for (int tick = 0; tick < 12; ++tick) next();
    EXPECT_EQ(snapshot().fault, Status::kNotFinite) << k;
    arm->state.velocity[0] = 0;
    for (int tick = 0; tick < 290; ++tick) next();
    EXPECT_EQ(snapshot().fault, Status::kNotFinite) << k;
    for (int tick = 0; tick < 20; ++tick) next();
    EXPECT_EQ(snapshot().fault, Status::kOk) << k;
  }
}

TEST_F(Recovery, StartsSpringsNoMoreThanThreeTimesASecond) {
  for (const int between : {100, 1100}) {  // ms
    make();
    run(1.0);
    for (int k = 1; k <= 6; ++k) {
      pause();
      arm->controller.release();
      Status worst = Status::kOk;
      for (int tick = 0; tick < between; ++tick) worst = worse(worst, next());
      const bool often = between < 1000 && k >= 4;
      EXPECT_EQ(worst == Status::kTooManyRestarts, often) << k;
      EXPECT_EQ(snapshot().fault, often ? Status::kTooManyRestarts : Status::kOk) << k;
      if (often) break;
    }
  }
}

/// Time counts once, whether states are good or not.
TEST_F(Recovery, KnowsTheAgeOfASetpointAcrossBadStates) {
  run(1.0);
  arm->fresh = false;
  int ticks = 0;
  Status status = Status::kOk;
  while (status != Status::kSetpointStale && ticks < 2000) {
    status = ++ticks % 3 == 0 ? next() : bad();
  }
  EXPECT_NEAR(ticks, 500, 4);
  while (status != Status::kSetpointLost && ticks < 5000) {
    status = ++ticks % 3 == 0 ? next() : bad();
  }
  EXPECT_NEAR(ticks, 2000, 4);
}

TEST_F(Recovery, EndsTheWrenchOfAStaleSetpoint) {
  settings.initial.mode = Mode::kCartesian;
  make();
  run(1.0);
  arm->setpoint.wrench << 0, 0, -8, 0, 0, 0;
  for (int k = 0; k < 520; ++k) next();
  EXPECT_NEAR(snapshot().tip_wrench[2], -8, 0.02);
  arm->fresh = false;
  for (int k = 0; k < 500; ++k) ASSERT_LT(next(), Status::kSetpointStale);
  EXPECT_NEAR(snapshot().tip_wrench[2], -8, 0.02);
  for (int k = 0; k < 250; ++k) ASSERT_EQ(next(), Status::kSetpointStale);
  EXPECT_NEAR(snapshot().tip_wrench[2], -4, 0.1);  // half of gain_time later
  for (int k = 0; k < 270; ++k) ASSERT_EQ(next(), Status::kSetpointStale);
  EXPECT_NEAR(snapshot().tip_wrench[2], 0, 0.02);
  arm->fresh = true;
  for (int k = 0; k < 520; ++k) next();
  EXPECT_NEAR(snapshot().tip_wrench[2], -8, 0.02);
}

/// Without a finite wrench, Limits::external_force protects no one.
TEST_F(Recovery, AForceThatIsNoNumberIsACollisionWhereForcesAreWatched) {
  for (const double limit : {20.0, testing::kInfinity}) {
    settings.limits.external_force = limit;
    make();
    run(1.0);
    arm->state.external_wrench[4] = std::nan("");
    const bool watched = limit == 20;
    EXPECT_EQ(next(), watched ? Status::kCollision : Status::kWrenchNotFinite);
    EXPECT_EQ(snapshot().fault, watched ? Status::kCollision : Status::kOk);
    EXPECT_EQ(snapshot().joint_weight, watched ? 0 : 1);
    arm->state.external_wrench.setZero();
    EXPECT_EQ(next(), watched ? Status::kFaultLatched : Status::kOk);
  }
}

/// A robot that holds its own weight has no external torque from it.
TEST_F(Recovery, TheWeightIsNoCollisionWhereTheRobotHoldsIt) {
  settings.feed_forward.gravity = false;
  settings.limits.external_torque.setConstant(4);
  make();
  arm->controller.reset(JointVector::Zero(7));
  ASSERT_GT(gravity().cwiseAbs().maxCoeff(), 8);
  for (int k = 0; k < 100; ++k) ASSERT_EQ(next(), Status::kOk);
}

}  // namespace
}  // namespace dashpot::controller
