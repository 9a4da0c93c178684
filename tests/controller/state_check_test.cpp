// The check of states by itself: a hinge, a continuous joint and a slide, each as fast as 2 rad/s
// (m/s).
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/safety/state_check.hpp>
#include <dashpot/tests/support/chains.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

namespace dashpot::controller {
namespace {

class Check : public ::testing::Test {
 protected:
  Check()
      : model(testing::chain_of({"revolute", "continuous", "prismatic"})),
        settings(default_settings(model)) {
    settings.watchdog.feedback = 0;
    state.position = state.velocity = JointVector::Zero(3);
  }
  void make() {
    state.position.setZero();
    state.velocity.setZero();
    check.emplace(model, settings);
    EXPECT_EQ(check->check(state), Status::kOk);
  }
  /// The state `milliseconds` later.
  Status next(double milliseconds = 1) {
    state.time += std::llround(1e6 * milliseconds);
    return check->check(state);
  }
  /// Takes the state without a position.
  Status bad(double milliseconds = 1) {
    const JointVector position = state.position;
    state.position[0] = std::numeric_limits<double>::quiet_NaN();
    const Status status = next(milliseconds);
    state.position = position;
    return status;
  }

  RobotModel model;
  Settings settings;
  RobotState state;
  std::optional<StateCheck> check;
};

/// 2 |v| t + 0.001 rad from the last good state, t seconds ago, however many bad ones came since.
TEST_F(Check, CountsAnOutageInTimeAndNotInTicks) {
  for (const int ticks : {0, 1, 3, 8}) {
    for (const double further : {-1e-6, 1e-6}) {
      for (const int joint : {0, 1, 2}) {
        make();
        for (int k = 0; k < ticks; ++k) EXPECT_EQ(bad(9.0 / ticks), Status::kStateNotFinite);
        const double t = ticks == 0 ? 0.001 : 0.010;
        state.position[joint] = 2 * t * 2 + 0.001 + further;
        EXPECT_EQ(next(), further > 0 ? Status::kStateJump : Status::kOk) << ticks;
        EXPECT_DOUBLE_EQ(check->age(), t);
      }
    }
  }
}

TEST_F(Check, CountsAPeriodWhereTheClockGoesBack) {
  make();
  EXPECT_EQ(next(-50), Status::kTimeBackward);
  EXPECT_DOUBLE_EQ(check->age(), 0.001);
  EXPECT_EQ(next(0), Status::kTimeBackward);
  EXPECT_DOUBLE_EQ(check->age(), 0.001);
  EXPECT_DOUBLE_EQ(check->backward(), 0.002);
  EXPECT_EQ(next(3), Status::kOk);  // which two periods have been counted of
  EXPECT_DOUBLE_EQ(check->age(), 0.001);
  EXPECT_EQ(check->backward(), 0);
  EXPECT_EQ(next(2), Status::kOk);
  EXPECT_DOUBLE_EQ(check->age(), 0.002);
}

/// A gap of longest_gap does not count: rates are counted across it.
TEST_F(Check, TellsAGapFromAShortInterruptionToTheNanosecond) {
  make();
  EXPECT_EQ(next(10), Status::kOk);
  EXPECT_EQ(next(10.000001), Status::kTimeGap);
  for (int k = 0; k < 9; ++k) EXPECT_EQ(bad(), Status::kStateNotFinite);
  EXPECT_EQ(next(), Status::kOk);
  make();
  for (int k = 1; k <= 50; ++k) {
    EXPECT_EQ(next(10), k < 50 ? Status::kOk : Status::kWrongRate) << k;
  }
  make();  // but a longer one begins again
  for (int k = 1; k < 50; ++k) EXPECT_EQ(next(10), Status::kOk);
  EXPECT_EQ(next(11), Status::kTimeGap);
  EXPECT_EQ(next(10), Status::kOk);
  make();  // and so do bad states for longer, also with good ones between
  for (int k = 1; k < 50; ++k) EXPECT_EQ(next(10), Status::kOk);
  for (int k = 0; k < 10; ++k) EXPECT_EQ(bad(), Status::kStateNotFinite);
  EXPECT_EQ(next(), Status::kOk);
  EXPECT_EQ(next(10), Status::kOk);
}

TEST_F(Check, NoticesALoopAtAnotherRate) {
  for (const double milliseconds : {0.6, 0.7, 1.4, 1.6}) {
    make();
    const bool wrong = milliseconds < 2.0 / 3 || milliseconds > 1.5;
    for (int k = 1; k <= 200; ++k) {
      EXPECT_EQ(next(milliseconds), wrong && k >= 50 ? Status::kWrongRate : Status::kOk) << k;
    }
  }
  make();
  for (int k = 0; k < 500; ++k) EXPECT_EQ(next(k % 2 == 0 ? 0.3 : 1.7), Status::kOk) << "jitter";
  make();  // later on, with the mean of about 50 intervals: 1 - (49/50)^k of 1 ms is half of it
  for (int k = 0; k < 1000; ++k) EXPECT_EQ(next(), Status::kOk);
  for (int k = 1; k <= 40; ++k) {
    EXPECT_EQ(next(2), k < 35 ? Status::kOk : Status::kWrongRate) << k;
  }
}

TEST_F(Check, JudgesTheRateAnewAfterAGap) {
  make();
  for (int k = 0; k < 100; ++k) EXPECT_EQ(next(1.2), Status::kOk);
  EXPECT_EQ(next(1000), Status::kTimeGap);
  for (int k = 1; k <= 60; ++k) {
    EXPECT_EQ(next(2), k < 50 ? Status::kOk : Status::kWrongRate) << k;
  }
}

/// With all velocities zero, all travelled distance u is unexplained, and u > tolerance + 0.3 u is
/// noticed. A tick later 1 - T / 0.5 s of it remains.
TEST_F(Check, NoticesPositionsThatMoveOtherwiseThanTheVelocitiesSay) {
  settings.watchdog.feedback = 0.5;
  for (const auto& [joint, tolerance] : {std::pair(0, 0.02), {1, 0.02}, {2, 0.005}}) {
    for (const double said : {0.0, 0.5, 2.0}) {  // of the motion
      make();
      const double v = 0.4, step = 1e-3 * v, larger = step * std::max(1.0, said);
      double unexplained = 0, travelled = 0;
      state.velocity[joint] = said * v;
      ASSERT_EQ(next(), Status::kOk);
      unexplained = -0.5 * said * step;  // a tick at rest, that began with velocity zero
      travelled = std::abs(unexplained);
      for (int k = 1; k <= 400; ++k) {
        unexplained = (1 - 1e-3 / 0.5) * unexplained + (1 - said) * step;
        travelled = (1 - 1e-3 / 0.5) * travelled + larger;
        const bool found = std::abs(unexplained) > tolerance + 0.3 * travelled;
        state.position[joint] += step;
        ASSERT_EQ(next(), found ? Status::kStateContradictory : Status::kOk) << joint << ' ' << k;
        if (found) {
          EXPECT_GT(k, 10);
          break;
        }
        ASSERT_LT(k, 400);
      }
    }
  }
}

/// From a contradiction on velocities are differences of positions, smoothed.
TEST_F(Check, TakesVelocitiesFromPositionsAfterAContradiction) {
  settings.watchdog.feedback = 0.5;
  make();
  state.velocity[0] = -0.8;
  int ticks = 0;
  do {
    EXPECT_EQ(check->velocity()[0], ticks == 0 ? 0 : -0.8);
    state.position[0] += 0.001;
    ASSERT_LT(++ticks, 100);
  } while (next() == Status::kOk);
  double smoothed = 1;  // from the first difference on
  for (int k = 0; k < 50; ++k) {
    const double v = k < 25 ? 1 : 0.4;
    EXPECT_NEAR(check->velocity()[0], smoothed, 1e-9) << k;
    smoothed += (v - smoothed) / 3;
    state.position[0] += 1e-3 * v;
    next();
  }
  state.velocity[0] = 0;
  for (int k = 0; k < 2000; ++k) next();  // the unexplained motion fades
  for (const bool trusted : {false, true}) {
    if (trusted) check->trust_velocities();
    const double before = check->velocity()[0];
    state.velocity[0] = 0.3;
    state.position[0] += 0.0003;
    EXPECT_EQ(next(), Status::kOk);
    EXPECT_NEAR(check->velocity()[0], trusted ? 0.3 : before + (0.3 - before) / 3, 1e-9);
  }
}

/// States that agree with each other for more than 20 ms are accepted, even if they are elsewhere.
TEST_F(Check, BelievesAJumpAfter20MillisecondsOfAgreement) {
  for (const double milliseconds : {1.1, 3.0, 7.0}) {
    make();
    state.position[0] = 1;
    const int agreeing = static_cast<int>(20.5 / milliseconds) + 1;
    for (int k = 0; k < agreeing; ++k) {
      ASSERT_EQ(next(milliseconds), Status::kStateJump) << milliseconds << ' ' << k;
      EXPECT_EQ(check->position()[0], 0);
    }
    EXPECT_EQ(next(milliseconds), Status::kOk) << milliseconds;
    EXPECT_EQ(check->position()[0], 1);
  }
  settings.watchdog.longest_gap = 0.03;  // or that, if it is longer
  make();
  state.position[0] = 1;
  for (int k = 0; k < 28; ++k) ASSERT_EQ(next(1.1), Status::kStateJump);
  EXPECT_EQ(next(1.1), Status::kOk);
}

TEST_F(Check, BelievesNoJumpsThatDisagree) {
  make();
  for (int k = 0; k < 100; ++k) {
    state.position[0] = 2 + 0.1 * (k % 2);
    EXPECT_EQ(next(), Status::kStateJump);
  }
  make();
  state.position[0] = 2;
  for (int k = 0; k < 15; ++k) EXPECT_EQ(next(), Status::kStateJump);
  EXPECT_GE(bad(), Status::kStateNotFinite);
  for (int k = 0; k < 15; ++k) EXPECT_EQ(next(), Status::kStateJump);
  make();  // agreement counts from the last good state
  for (int k = 0; k < 40; ++k) {
    state.position[0] = k % 10 == 0 ? 0 : 2;
    EXPECT_EQ(next(), k % 10 == 0 ? Status::kOk : Status::kStateJump);
  }
}

/// Angles of a continuous joint may come modulo a turn; a hinge's angles may not.
TEST_F(Check, FollowsAContinuousJointAcrossItsWrap) {
  constexpr double kWrap = 2 * std::numbers::pi;
  make();
  double angle = 0;
  for (int k = 0; k < 5000; ++k) {
    angle += 0.0019;
    state.position[1] = std::remainder(angle, kWrap);
    state.velocity[1] = 1.9;
    ASSERT_EQ(next(), Status::kOk) << k;
    ASSERT_NEAR(check->position()[1], angle, 1e-9);
  }
  make();
  state.position[0] = kWrap;
  EXPECT_EQ(next(), Status::kStateJump);
}

/// Far away, where whole turns have no exact remainder, any number would do.
TEST_F(Check, TakesNoGarbageForAnAngle) {
  for (const double garbage : {1.1e6, 1e16, -1e17, 1e20, -1e300}) {
    for (const double last : {0.0, 0.5}) {
      make();
      state.position[1] = last;
      check->reset();
      EXPECT_EQ(next(), Status::kOk);
      state.position[1] = garbage;
      EXPECT_EQ(next(), Status::kStateJump) << garbage << " after " << last;
      EXPECT_EQ(check->position()[1], last);
    }
  }
}

TEST_F(Check, IsNewAfterAReset) {
  settings.watchdog.feedback = 0.5;
  make();
  state.velocity[0] = 1;
  for (int k = 0; k < 100; ++k) next();  // contradicts
  state.position.setConstant(2);
  state.velocity.setConstant(-1);
  state.time -= 1'000'000'000;
  check->reset();
  EXPECT_EQ(check->velocity(), JointVector(JointVector::Zero(3)));
  EXPECT_EQ(check->check(state), Status::kOk);
  EXPECT_EQ(check->velocity(), state.velocity);
  for (int k = 1; k < 50; ++k) {
    state.position.array() -= 0.002;
    EXPECT_EQ(next(2), Status::kOk);
    EXPECT_EQ(check->velocity(), state.velocity);
  }
  state.position.array() -= 0.002;
  EXPECT_EQ(next(2), Status::kWrongRate);
}

}  // namespace
}  // namespace dashpot::controller
