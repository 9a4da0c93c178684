// States that cannot be trusted: the torque is ramped down, and the controller recovers.
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/safety.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

namespace dashpot::controller {
namespace {

using testing::kInfinity;
using testing::near;
using testing::Safety;

/// A disturbance of a state, and its status; a jump is accepted after some time, see below.
struct Spoiler {
  Status status;
  void (*spoil)(RobotState& state);
};
const Spoiler kSpoilers[] = {
    {Status::kStateNotFinite, [](RobotState& state) { state.position[1] = std::nan(""); }},
    {Status::kStateNotFinite, [](RobotState& state) { state.velocity[6] = kInfinity; }},
    {Status::kStateWrongSize, [](RobotState& state) { state.position.conservativeResize(6); }},
    {Status::kStateWrongSize, [](RobotState& state) { state.velocity.resize(0); }},
    {Status::kStateJump, [](RobotState& state) { state.position[5] += 0.2; }},
    {Status::kStateJump, [](RobotState& state) { state.velocity[5] += 2.0; }},
    {Status::kTimeBackward, [](RobotState& state) { state.time -= 5'000'000; }},
};

/// A fault for some ticks: the torque ramps to zero, and a good state brings the controller back.
class Ramp : public Safety, public ::testing::WithParamInterface<int> {
 protected:
  void spoil(RobotState& state) const { kSpoilers[GetParam()].spoil(state); }
  Status expected() const { return kSpoilers[GetParam()].status; }
};
INSTANTIATE_TEST_SUITE_P(Faults, Ramp, ::testing::Range(0, 7));

TEST_P(Ramp, OneBadTickCostsLittleAndNothingStartsAfresh) {
  run(1.0);
  const JointVector before = arm->torque;
  const RobotState good = arm->state;
  arm->setpoint.time = arm->state.time;
  spoil(arm->state);
  EXPECT_EQ(tick(), expected());
  EXPECT_TRUE(near(arm->torque, before, 1e-9));
  arm->state = good;
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_TRUE(near(arm->torque, before, 1e-3));
  EXPECT_EQ(snapshot().restarts, 1u);
}

class LongRamp : public Ramp {};
INSTANTIATE_TEST_SUITE_P(Faults, LongRamp, ::testing::Range(0, 4));

TEST_P(LongRamp, HoldsTheWeightForTwoSecondsAndStartsAfresh) {
  run(1.0);
  const RobotState good = arm->state;
  const JointVector weight = gravity();
  JointVector last = arm->torque;
  const JointVector step = settings.limits.torque_rate * settings.period;
  for (int k = 0; k < 2150; ++k) {
    arm->state = good;
    arm->state.time += std::int64_t{1'000'000} * k;
    spoil(arm->state);
    EXPECT_EQ(tick(), expected());
    if (k > 200 && k < 1990) ASSERT_TRUE(near(arm->torque, weight, 1e-3)) << k;
    EXPECT_TRUE(k < 2010 || arm->torque.norm() < last.norm() || k >= 2100);
    EXPECT_LE(((arm->torque - last).cwiseAbs() - step).maxCoeff(), 1e-12);
    last = arm->torque;
  }
  EXPECT_EQ(arm->torque.norm(), 0.0);
  const std::int64_t time = std::max(good.time, arm->state.time);
  arm->state = good;
  arm->state.time = time;
  arm->fresh = true;
  for (int k = 0; k < 500; ++k) {
    EXPECT_GE(arm->step(), Status::kFaultLatched);
    EXPECT_EQ(snapshot().fault, expected());
  }
  arm->controller.release();
  for (int k = 0; k < 3000; ++k) arm->step();
  EXPECT_EQ(snapshot().status, Status::kOk);
  EXPECT_EQ(snapshot().restarts, 2u);
}

/// If time stamps are wrong and positions are good, the weight is held and the brake acts.
TEST_F(Safety, WrongTimeStampsDropNoArm) {
  const std::vector<std::function<std::int64_t(std::int64_t)>> clocks = {
      [](std::int64_t) { return 0; },                      // stands still
      [](std::int64_t ns) { return -ns; },                 // runs backward
      [](std::int64_t ns) { return ns / 1'000'000'000; },  // counts seconds,
      [](std::int64_t ns) { return ns / 1000; },           // us,
      [](std::int64_t ns) { return ns / 1'000'000; }};     // ms
  for (std::size_t clock = 0; clock < clocks.size(); ++clock) {
    make();
    run(1.0);
    const JointVector start = arm->state.position;
    const std::int64_t from = arm->state.time;
    std::int64_t passed = 0;
    for (int k = 0; k < 1500; ++k) {
      arm->state.time = from + clocks[clock](passed += 1'000'000);
      arm->state.external_wrench[0] = k >= 400 && k < 418 ? 10 : 0;  // a person bumps into it
      arm->setpoint.time = arm->state.time;
      arm->fresh = false;
      const std::int64_t told = arm->state.time;
      arm->step();
      arm->state.time = told;
    }
    const bool slow = clock > 2;
    EXPECT_EQ(snapshot().fault, slow ? Status::kWrongRate : Status::kTimeBackward) << clock;
    EXPECT_LT((arm->state.position - start).cwiseAbs().maxCoeff(), 0.05) << clock;
    EXPECT_LT(arm->state.velocity.cwiseAbs().maxCoeff(), 0.01) << clock;
    EXPECT_TRUE(near(arm->torque, gravity(), 0.1)) << clock;
  }
}

/// An encoder that slips, or wraps by a turn: the right state is unknown.
TEST_F(Safety, AStateThatStaysElsewhereLatchesAndIsFollowedWithoutSprings) {
  for (const double slip : {0.3, 2 * 3.14159265358979}) {
    make();
    run(1.0);
    arm->state.position[5] += slip;
    EXPECT_EQ(next(), Status::kStateJump);
    int ticks = 1;
    while (next() == Status::kStateJump && ticks < 1000) ++ticks;
    EXPECT_GE(ticks, 20);  // the states agree with each other for 20 ms
    EXPECT_LT(ticks, 30);
    EXPECT_EQ(snapshot().fault, Status::kStateJump);
    for (int k = 0; k < 300; ++k) next();
    EXPECT_EQ(snapshot().restarts, 1u);
    EXPECT_EQ(snapshot().joint_weight, 0);
    EXPECT_TRUE(near(arm->torque, gravity(), 1e-6));  // and no return into the limits
  }
}

/// Several bad states while the arm moves are compared each with the last good one by its age.
TEST_F(Safety, GoesOnAfterBadStatesWhileMoving) {
  run(1.0);
  const double v = 1.5;
  const auto move = [&] {
    arm->state.position[5] += 1e-3 * v;
    arm->state.velocity[5] = v;
  };
  for (int k = 0; k < 100; ++k) {
    move();
    next();
  }
  const JointVector before = arm->torque;
  for (int k = 0; k < 8; ++k) {  // 12 mrad: further than a state a tick old could be
    move();
    const RobotState good = arm->state;
    arm->state.position[2] = std::nan("");
    EXPECT_EQ(next(), Status::kStateNotFinite);
    const std::int64_t time = arm->state.time;
    arm->state = good;
    arm->state.time = time;
  }
  move();
  EXPECT_LT(next(), Status::kSetpointRejected);
  EXPECT_EQ(snapshot().fault, Status::kOk);
  EXPECT_EQ(snapshot().restarts, 1u);
  EXPECT_TRUE(near(arm->torque, before, 1.0));
}

/// If velocities contradict the positions, the brake uses the positions.
TEST_F(Safety, VelocitiesThatContradictThePositionsLatch) {
  settings.watchdog.feedback = 0.5;
  for (const double scale : {0.0, -1.0, 3.0}) {
    make();
    run(1.0);
    int ticks = 0;
    const double v = 0.5;
    while (snapshot().fault == Status::kOk && ticks < 1000) {
      arm->state.position[4] += 1e-3 * v;
      arm->state.velocity[4] = scale * v;
      next();
      ++ticks;
    }
    EXPECT_EQ(snapshot().fault, Status::kStateContradictory) << scale;
    EXPECT_LT(ticks, 100) << scale;
    EXPECT_NEAR(snapshot().velocity[4], v, 1e-9) << scale;  // at once
    for (int k = 0; k < 300; ++k) {
      arm->state.position[4] += 1e-3 * v;
      next();
    }
    const auto there = evaluate(model, arm->state.position, arm->state.velocity);
    EXPECT_NEAR((arm->torque - gravity())[4], -there.M(4, 4) * v / 0.05, 1e-6) << scale;
  }
}

TEST_F(Safety, AStateThatNeverChangesWhileTheTorqueDoesLatches) {
  settings.watchdog.feedback = 0.5;
  make();
  run(1.0);
  for (int k = 0; k < 1000; ++k) next();  // at rest there is no contradiction
  EXPECT_EQ(snapshot().fault, Status::kOk);
  arm->setpoint.joint_position[1] += 0.5;
  int ticks = 0;
  while (snapshot().fault == Status::kOk && ticks < 5000) {
    next();
    ++ticks;
  }
  EXPECT_EQ(snapshot().fault, Status::kStateFrozen);
  EXPECT_LT(ticks, 1500);
  for (int k = 0; k < 300; ++k) next();
  EXPECT_TRUE(near(arm->torque, gravity(), 1e-6));
  // Good feedback damps again, although the fault is not released.
  for (int k = 0; k < 300; ++k) {
    arm->state.velocity[1] = 0.3;
    arm->state.position[1] += 1e-3 * arm->state.velocity[1];
    next();
    ASSERT_EQ(snapshot().fault, Status::kStateFrozen);
  }
  const JointVector damping = arm->torque - gravity();
  EXPECT_LT(damping[1], -1);
}

/// Bits that repeat while the arm creeps are a fault within 50 ms, and within 0.2 s however slowly.
TEST_F(Safety, AStateThatFreezesInACreepingMotionLatches) {
  settings.watchdog.feedback = 0.5;
  for (const double v : {0.03, 0.003, 0.0006}) {
    make();
    run(1.0);
    arm->state.velocity[4] = v;
    for (int k = 0; k < 20; ++k) {
      arm->state.position[4] += 1e-3 * v;
      next();
    }
    int ticks = 0;
    for (; snapshot().fault == Status::kOk && ticks < 300; ++ticks) next();
    EXPECT_EQ(snapshot().fault, Status::kStateFrozen) << v;
    EXPECT_LE(ticks, v > 0.0025 ? 50 : 200) << v;
  }
}

/// Swings that grow are an instability, also if a reference lost its springs in motion: it does not
/// count as moving.
TEST_F(Safety, SwingsThatGrowAfterAChangeOfModeLatch) {
  settings.motion.gain_time = 0.002;
  make();
  run(1.0);
  arm->setpoint.joint_position[0] += 1;
  for (int k = 0; k < 300; ++k) arm->step();
  EXPECT_GT(snapshot().reference_velocity.norm(), 0.1);
  arm->setpoint.mode = Mode::kCartesian;
  arm->setpoint.tip_pose = arm->tip();
  for (int k = 0; k < 3000; ++k) arm->step();
  const double center = arm->state.position[4];
  for (int k = 0; k < 1500 && snapshot().fault == Status::kOk; ++k) {
    const double t = 1e-3 * k, w = 40, speed = 0.02 * std::exp(3 * t);
    arm->state.position[4] = center + speed / w * std::sin(w * t);
    arm->state.velocity[4] = speed * std::cos(w * t);
    next();
  }
  EXPECT_EQ(snapshot().fault, Status::kInstability);
}

TEST_F(Safety, AWallIsNotCrossed) {
  settings.limits.walls = {
      {arm->tip().position - Eigen::Vector3d(0, 0, 0.05), Eigen::Vector3d::UnitZ()}};
  settings.initial.mode = Mode::kCartesian;
  make();
  run(1.0);
  arm->setpoint.tip_pose.position.z() -= 0.06;
  EXPECT_EQ(arm->step(), Status::kSetpointRejected);
  arm->setpoint.tip_pose.position.z() += 0.02;
  EXPECT_LT(arm->step(), Status::kSetpointRejected);
  for (int k = 0; k < 3000 && snapshot().fault == Status::kOk; ++k) {
    arm->state.external_wrench[2] = -0.05 * k;  // a person pushes
    arm->step();
  }
  EXPECT_EQ(snapshot().fault, Status::kWall);
}

TEST_F(Safety, ACollisionLatches) {
  settings.limits.external_torque.setConstant(4);
  make();
  run(1.0);
  int ticks = 0;
  while (snapshot().fault == Status::kOk && ticks < 1000) {
    arm->state.external_wrench[0] = 45;
    arm->step();
    ++ticks;
  }
  EXPECT_EQ(snapshot().fault, Status::kCollision);
  EXPECT_LT(ticks, 40);
}

TEST_F(Safety, ShowsWhatIsMeasuredWhileTheTorqueIsRampedDown) {
  run(1.0);
  arm->state.position[5] += 0.3;
  arm->state.velocity[5] = 0.1;
  ASSERT_EQ(next(), Status::kStateJump);
  EXPECT_EQ(snapshot().position, arm->state.position);
  EXPECT_EQ(snapshot().velocity, arm->state.velocity);
  const JointVector last = arm->state.position;
  arm->state.position[2] = std::nan("");
  ASSERT_EQ(next(), Status::kStateNotFinite);
  EXPECT_EQ(snapshot().position, last);
}

TEST_F(Safety, AnExternalWrenchThatIsNotFiniteIsReportedAndChangesNothing) {
  settings.task_terms.load = Load::kJointTorques;
  settings.analysis.where = Analysis::Where::kInline;
  settings.analysis.share = 1;  // all within the tick
  settings.initial.mode = Mode::kCartesian;
  make();
  arm->state.external_wrench << 5, 0, 20, 0, 0, 1;
  arm->controller.reset(gravity());
  for (int k = 0; k < 700; ++k) next();
  ASSERT_EQ(next(), Status::kOk);
  const JointVector before = arm->torque;
  const double frequency = arm->controller.vibration().modes[0].natural_frequency;
  const Vector6 good = arm->state.external_wrench;
  for (const double bad : {std::nan(""), kInfinity, -kInfinity}) {
    for (int i = 0; i < 6; ++i) {
      arm->state.external_wrench = good;
      arm->state.external_wrench[i] = bad;
      EXPECT_EQ(next(), Status::kWrenchNotFinite);
      EXPECT_TRUE(near(arm->torque, before, 1e-9));
      EXPECT_EQ(arm->controller.vibration().status, analysis::Status::kOk);
      EXPECT_EQ(arm->controller.vibration().modes[0].natural_frequency, frequency);
    }
  }
  arm->state.external_wrench = good;
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_EQ(snapshot().restarts, 1u);
}

/// The motion at the loss of the state is braked by the motion that the model predicts.
TEST_F(Safety, BrakesAMotionThatNobodySeesAnyMore) {
  run(1.0);
  const JointVector weight = gravity();
  const auto there = evaluate(model, arm->state.position, arm->state.velocity);
  JointVector v = JointVector::Constant(7, 0.1);
  for (int k = 0; k < 3; ++k) {
    arm->state.velocity = v;
    arm->state.position += 1e-3 * v;
    next();
  }
  arm->state.position[0] = std::nan("");
  JointVector impulse = JointVector::Zero(7);
  for (int k = 0; k < 1000; ++k) {
    next();
    if (snapshot().fault != Status::kOk) impulse += 1e-3 * (arm->torque - weight);
  }
  EXPECT_TRUE(near(arm->torque, weight, 0.1));
  EXPECT_TRUE(near(impulse, JointVector(-(there.M * v)), 0.05 * (there.M * v).norm()));
}

TEST_F(Safety, ARampTakesTheTorqueFromAllJointsAlike) {
  settings.limits.torque_rate.setConstant(100);  // too little for the largest torque in 0.1 s
  make();
  run(1.0);
  arm->state.position[1] = std::nan("");
  for (int k = 0; k < 2000; ++k) next();
  const JointVector before = arm->torque;
  Eigen::Index heaviest = 0;
  ASSERT_GT(before.cwiseAbs().maxCoeff(&heaviest), 15);
  arm->state.position[1] = std::nan("");
  for (int k = 1; k <= 20; ++k) {
    next();
    const double share = arm->torque[heaviest] / before[heaviest];
    EXPECT_NEAR((1 - share) * std::abs(before[heaviest]), 0.1 * k, 1e-9);
    EXPECT_TRUE(near(arm->torque, share * before, 1e-9)) << k;
  }
}

}  // namespace
}  // namespace dashpot::controller
