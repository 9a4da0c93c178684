// Every status: how it comes about, its safe output, and how the controller recovers.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>

namespace dashpot::controller {
namespace {

using testing::near;
using testing::SimulatedArm;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

class Safety : public ::testing::Test {
 protected:
  explicit Safety(const std::function<void(Settings&)>& change = [](Settings&) {})
      : model(testing::arm_model(testing::arms()[0])), settings(testing::quiet_settings(model)) {
    change(settings);
    make();
  }
  void make() { arm = std::make_unique<SimulatedArm>(model, settings, testing::panda_ready()); }
  void run(double seconds) {
    for (int k = 0; k < static_cast<int>(seconds / settings.period); ++k) {
      ASSERT_EQ(arm->step(), Status::kOk) << to_text(arm->controller.snapshot().status);
    }
  }
  Status tick() {  // no motion
    return arm->controller.update(arm->state, arm->setpoint, arm->torque);
  }
  /// A tick one period later, with a fresh set-point.
  Status next() {
    arm->state.time += 1'000'000;
    if (arm->fresh) arm->setpoint.time = arm->state.time;
    return tick();
  }
  JointVector gravity() const {
    return evaluate(model, arm->state.position, arm->state.velocity).gravity;
  }
  const Snapshot& snapshot() const { return arm->controller.snapshot(); }

  RobotModel model;
  Settings settings;
  std::unique_ptr<SimulatedArm> arm;
};

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

TEST_F(Safety, RejectsBadSetpointsAndKeepsTheLastGoodOne) {
  run(1.0);
  const double nan = std::nan("");
  const std::vector<std::pair<const char*, std::function<void(Setpoint&)>>> spoilers = {
      {"NaN", [&](Setpoint& s) { s.joint_position[2] = nan; }},
      {"wrong size", [](Setpoint& s) { s.joint_position.conservativeResize(6); }},
      {"no position", [](Setpoint& s) { s.joint_position.resize(0); }},
      {"unreachable", [](Setpoint& s) { s.joint_position[3] = 0.5; }},
      {"gains of wrong size", [](Setpoint& s) { s.gains.joint_stiffness.setIdentity(6, 6); }},
      {"indefinite", [](Setpoint& s) { s.gains.joint_damping(0, 0) = -1; }},
      {"asymmetric", [](Setpoint& s) { s.gains.joint_stiffness(0, 1) += 1; }},
      {"infinite gain", [](Setpoint& s) { s.gains.joint_stiffness(0, 0) = kInfinity; }},
      {"huge gain", [](Setpoint& s) { s.gains.joint_stiffness(0, 0) = 1e10; }},
      {"wrench", [&](Setpoint& s) { s.wrench[3] = nan; }},
      {"mode", [](Setpoint& s) { s.mode = static_cast<Mode>(7); }},
      {"time to come", [](Setpoint& s) { s.time += 1'000'000'000; }},
      {"no rotation", [](Setpoint& s) { s.mode = Mode::kCartesian, s.tip_pose.rotation *= 1.001; }},
      {"reflection", [](Setpoint& s) { s.mode = Mode::kCartesian, s.tip_pose.rotation *= -1.0; }},
      {"far away", [](Setpoint& s) { s.mode = Mode::kCartesian, s.tip_pose.position.x() = 1e7; }},
      {"pose NaN", [&](Setpoint& s) { s.mode = Mode::kCartesian, s.tip_pose.position.x() = nan; }},
      {"task gains",
       [](Setpoint& s) { s.mode = Mode::kCartesian, s.gains.task_stiffness(2, 2) = -1; }},
      {"null gains",
       [](Setpoint& s) { s.mode = Mode::kCartesian, s.gains.null_damping[0] = -0.1; }},
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
    EXPECT_EQ(tick(), Status::kSetpointRejected);  // looked at once, reported while it stands
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
  EXPECT_EQ(snapshot().setpoint_velocity.norm(), 0.0);
  EXPECT_EQ(snapshot().joint_weight, 1.0);
  const JointVector held = snapshot().setpoint_position;
  EXPECT_LT(held[0], arm->setpoint.joint_position[0] - 0.1);  // stopped on the way
  for (int k = 0; k < 302; ++k) arm->step();
  EXPECT_EQ(snapshot().status, Status::kSetpointLost);
  EXPECT_EQ(snapshot().joint_weight, 0.0);
  const JointVector expected =
      gravity() - settings.limits.damping.cwiseProduct(arm->state.velocity);
  tick();
  EXPECT_TRUE(near(arm->torque, expected, 1e-3));
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

/// A fault for some ticks: the torque ramps to zero, and a good state brings the controller back.
class Ramp : public Safety, public ::testing::WithParamInterface<int> {
 protected:
  void spoil(RobotState& state) const {
    switch (GetParam()) {
      case 0:
        state.position[1] = std::nan("");
        break;
      case 1:
        state.velocity[6] = kInfinity;
        break;
      case 2:
        state.position.conservativeResize(6);
        break;
      case 3:
        state.velocity.resize(0);
        break;
      case 4:
        state.position[5] += 0.2;
        break;
      case 5:
        state.velocity[5] += 2.0;
        break;
      case 6:
        state.time -= 5'000'000;
        break;
      default:
        break;
    }
  }
  Status expected() const {
    constexpr Status kExpected[] = {Status::kStateNotFinite, Status::kStateNotFinite,
                                    Status::kStateWrongSize, Status::kStateWrongSize,
                                    Status::kStateJump,      Status::kStateJump,
                                    Status::kTimeBackward};
    return kExpected[GetParam()];
  }
};
INSTANTIATE_TEST_SUITE_P(Faults, Ramp, ::testing::Range(0, 7));

TEST_P(Ramp, OneBadTickCostsLittleAndNothingStartsAfresh) {
  run(1.0);
  const JointVector before = arm->torque;
  const RobotState good = arm->state;
  arm->setpoint.time = arm->state.time;
  spoil(arm->state);
  EXPECT_EQ(tick(), expected());
  EXPECT_TRUE(near(arm->torque, 0.99 * before, 1e-9));
  arm->state = good;
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_TRUE(near(arm->torque, before, 1e-3));
  EXPECT_EQ(snapshot().restarts, 1u);
}

class LongRamp : public Ramp {};
// A jump is believed after a while, see below.
INSTANTIATE_TEST_SUITE_P(Faults, LongRamp, ::testing::Values(0, 1, 2, 3, 6));

TEST_P(LongRamp, EndsAtZeroTorqueAndStartsAfresh) {
  run(1.0);
  const RobotState good = arm->state;
  JointVector last = arm->torque;
  const JointVector step = settings.limits.torque_rate * settings.period;
  for (int k = 0; k < 150; ++k) {
    arm->state = good;
    arm->state.time += expected() == Status::kTimeBackward ? -k : 1'000'000 * k;
    spoil(arm->state);
    EXPECT_EQ(tick(), expected());
    EXPECT_TRUE(arm->torque.norm() < last.norm() || k >= 100);
    EXPECT_LE(((arm->torque - last).cwiseAbs() - step).maxCoeff(), 1e-12);
    last = arm->torque;
  }
  EXPECT_EQ(arm->torque.norm(), 0.0);
  const std::int64_t time = std::max(good.time, arm->state.time);
  arm->state = good;
  arm->state.time = time;
  arm->fresh = true;
  std::set<Status> seen;
  for (int k = 0; k < 3000; ++k) seen.insert(arm->step());
  EXPECT_EQ(snapshot().status, Status::kOk);
  EXPECT_EQ(snapshot().restarts, 2u);
}

TEST_F(Safety, AStateThatStaysElsewhereIsBelievedAndSpringsStartThere) {
  run(1.0);
  arm->state.position[5] += 0.3;
  EXPECT_EQ(next(), Status::kStateJump);
  int ticks = 1;
  while (next() == Status::kStateJump && ticks < 1000) ++ticks;
  EXPECT_GE(ticks, 20);  // the states agree with each other for 20 ms
  EXPECT_LT(ticks, 30);
  EXPECT_EQ(snapshot().restarts, 2u);
  EXPECT_NEAR(snapshot().setpoint_position[5], arm->state.position[5], 1e-4);
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

TEST_F(Safety, AFlickeringSensorIsNeverBelieved) {
  run(1.0);
  for (int k = 0; k < 50; ++k) {  // 0.5 rad to and fro, at rest: before the bound has grown to it
    arm->state.position[5] += k % 2 == 0 ? 0.5 : -0.5;
    EXPECT_EQ(next(), k % 2 == 0 ? Status::kStateJump : Status::kOk);
  }
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

}  // namespace
}  // namespace dashpot::controller
