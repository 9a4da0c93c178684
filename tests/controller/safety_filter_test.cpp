// The filter of torques by itself, on two joints that differ: every number follows from the
// equations in safety_filter.hpp.
#include <dashpot/controller/safety/safety_filter.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

namespace dashpot::controller {
namespace {

using testing::near;
using Pair = Eigen::Vector2d;

/// Joint 1 is heavy: its repulsion and its way to the limit are bounded by its torque. Joint 2 is
/// light: they are bounded by what the sampled loop bears.
class Filter : public ::testing::Test {
 protected:
  Filter() {
    const auto pair = [](double a, double b) { return JointVector(Pair(a, b)); };
    settings.limits.torque = pair(40, 10);
    settings.limits.torque_rate = pair(1e6, 1e6);
    settings.limits.velocity = pair(2, 3);
    settings.limits.tip_velocity = 1.5;
    settings.limits.position_lower = pair(-1, -2);
    settings.limits.position_upper = pair(1, 2);
    settings.limits.position_margin = pair(0.125, 0.25);
    settings.limits.return_velocity = pair(0.05, 0.1);
  }
  SafetyFilter make() const { return {settings, inertia}; }
  /// What the filter makes of `tau`.
  Status apply(SafetyFilter& filter, const Pair& tau) {
    out = tau;
    return filter.apply({q, qd, tip_speed, springs, returns}, weight, out);
  }
  Status apply(const Pair& tau) {
    SafetyFilter filter = make();
    return apply(filter, tau);
  }

  JointVector ramp(SafetyFilter& filter) {
    filter.ramp(out);
    return out;
  }

  Settings settings;
  const Pair inertia{0.5, 1e-4};
  const Pair damper{200, 0.04};  // c; F is 20 and 0.012 N m, E is 40 and 5 N m
  Pair q = Pair::Zero(), qd = Pair::Zero(), weight = Pair::Zero();
  JointVector out;
  double tip_speed = 0;
  bool springs = true, returns = false;
};

TEST_F(Filter, CountsEveryDelayOfTheLoop) {
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.001);
  settings.analysis.sampled.delay = 2;
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.003);
  settings.analysis.sampled.difference_velocity = true;
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.0035);
  settings.analysis.sampled.cutoff = 50;
  EXPECT_DOUBLE_EQ(loop_lag(settings), 0.0035 + 0.01 / std::numbers::pi);
}

/// Of a joint whose weight is about at its limit 5 % of the limit are left to say how much all
/// joints shrink.
TEST_F(Filter, ShrinksAllJointsAlikeBeyondTheWeight) {
  weight = {39, 0};
  EXPECT_EQ(apply({49, 4}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(40, 4 * 0.2), 1e-12));  // 2 N m of 10
  EXPECT_EQ(apply({29, 4}), Status::kOk);            // away from the limit there is room
  EXPECT_TRUE(near(out, Pair(29, 4), 1e-12));
  EXPECT_EQ(apply({-139, 4}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(-40, 4 * 79.0 / 178), 1e-12));
  weight = {30, 0};
  EXPECT_EQ(apply({50, 20}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(40, 10), 1e-12));
  EXPECT_EQ(apply({50, 25}), Status::kTorqueLimited);  // the other joint shrinks it most
  EXPECT_TRUE(near(out, Pair(30 + 20 * 0.4, 10), 1e-12));
  weight = {-50, 0};
  EXPECT_EQ(apply({-60, 4}), Status::kWeightNotHeld);
  EXPECT_TRUE(near(out, Pair(-40, 4 * 0.2), 1e-12));
  weight = {40, -10};
  EXPECT_EQ(apply(weight), Status::kOk);
}

/// Dampers alone lose nothing where another joint is at its limit.
TEST_F(Filter, ClipsOneByOneWithoutSprings) {
  weight = {39, 0};
  springs = false;
  settings.limits.power = 1;
  qd = {0.1, 0.1};
  EXPECT_EQ(apply({59, 4}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(40, 4), 1e-12));
}

TEST_F(Filter, ShrinksToThePowerLimit) {
  settings.limits.power = 10;
  qd = {1, 0.5};
  EXPECT_EQ(apply({8, 8}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(8, 8) * (10.0 / 12), 1e-12));
  EXPECT_EQ(apply({6, 8}), Status::kOk);
  EXPECT_EQ(apply({-30, -8}), Status::kOk);  // brakes
}

TEST_F(Filter, GivesARobotNoEnergyThatIsAboutAsFastAsItsLimit) {
  qd = {0.1, 0.1};
  for (const double share : {0.64, 0.7, 0.775, 0.85, 0.9, 0.95, 2.0}) {
    tip_speed = share * 1.5;
    const double left = std::clamp((0.9 - share) / 0.25, 0.0, 1.0);
    EXPECT_EQ(apply({30, 5}), left < 1 - 1e-9 ? Status::kTorqueLimited : Status::kOk) << share;
    EXPECT_TRUE(near(out, left * Pair(30, 5), 1e-9)) << share;
    EXPECT_EQ(apply({-30, 5}), Status::kOk);  // takes more than it gives
    EXPECT_TRUE(near(out, Pair(-30, 5), 1e-12));
  }
  // The repulsion does not, either.
  q = {0.9375, 0};
  qd = {-0.01, 0};
  tip_speed = 0.95 * 1.5;
  EXPECT_EQ(apply({0, 0}), Status::kNearJointLimit);
  EXPECT_TRUE(near(out, Pair(0, 0), 1e-12));
}

/// A joint that is fast is driven with no more than what can be taken away in time.
TEST_F(Filter, BoundsWhatDrivesAJointThatIsFast) {
  const double more = (0.65 - 0.6) / 0.15;  // of a torque limit, at 0.6 of a velocity limit
  qd = {1.2, 0};
  settings.limits.torque[0] = 400;
  EXPECT_EQ(apply({300, 9}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(200 * (1.8 - 1.2) + 400 * more, 9), 1e-9));
  EXPECT_EQ(apply({250, 9}), Status::kOk);
  EXPECT_EQ(apply({-300, 9}), Status::kOk);  // it brakes
  settings.limits.torque[0] = 40;
  settings.limits.torque_rate.setConstant(1000);
  SafetyFilter filter = make();
  for (int k = 0; k < 50; ++k) EXPECT_EQ(apply(filter, {39, 9}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(std::sqrt(1000 * 0.5 * (1.8 - 1.2)) + 40 * more, 9), 1e-9));
  settings.limits.torque_rate.setConstant(1e6);
  qd = {0, -1.8};
  EXPECT_EQ(apply({0, -9}), Status::kTorqueLimited);
  EXPECT_NEAR(out[1], -(0.04 * (2.7 - 1.8) + 10 * more), 1e-9);
  qd = {0, 1.5};  // half its limit
  EXPECT_EQ(apply({0, 9.9}), Status::kOk);
  qd = {0, 2.8};  // beyond 0.9 of it
  EXPECT_EQ(apply({0, 9.9}), Status::kTorqueLimited);
  EXPECT_EQ(out[1], 0);
}

TEST_F(Filter, PushesBackFromALimitAndEndsTheTorqueTowardIt) {
  for (const double side : {1.0, -1.0}) {
    q = {side * 0.90625, 0};  // three quarters of the margin away
    EXPECT_EQ(apply({side * 30, 0}), Status::kNearJointLimit);
    EXPECT_NEAR(out[0], side * (30 - 20 * 0.0625), 1e-9);
    q[0] = side * 0.96875;
    EXPECT_EQ(apply({side * 30, 0}), Status::kNearJointLimit);
    EXPECT_NEAR(out[0], side * (40 * 0.25 - 20 * 0.5625), 1e-9);
    EXPECT_EQ(apply({side * -5, 0}), Status::kNearJointLimit);
    EXPECT_NEAR(out[0], side * (-5 - 20 * 0.5625), 1e-9);
    qd = {side * 0.03, 0};
    apply({0, 0});
    EXPECT_NEAR(out[0], side * (-20 * 0.5625 - 200 * 0.75 * 0.03), 1e-9);
    springs = false;
    apply({0, 0});
    EXPECT_NEAR(out[0], side * (-200 * 0.75 * 0.03), 1e-9);
    springs = true;
    qd.setZero();
    q = {0, side * 1.875};
    apply({0, side * 9});  // the light joint bears 5 N m
    EXPECT_NEAR(out[1], side * (5 * 0.5 - 0.012 * 0.25), 1e-9);
    q = {side, side * 1.75};  // at the limit; at the margin's end
    EXPECT_EQ(apply({side * 3, 0}), Status::kNearJointLimit);
    EXPECT_TRUE(near(out, Pair(side * -20, 0), 1e-12));
    q = {0, side * 1.75};
    EXPECT_EQ(apply({0, 0}), Status::kOk);
    q = {0, 0};
  }
}

TEST_F(Filter, ReturnsFromOutsideWithATorqueThatGrowsWithinASecond) {
  for (const double side : {1.0, -1.0}) {
    q = {side * 1.01, 0};
    qd.setZero();
    returns = true;
    SafetyFilter filter = make();
    EXPECT_EQ(apply(filter, {side * 30, 0}), Status::kPositionLimit);
    EXPECT_NEAR(out[0], 0, 1e-12);  // no spring, and not yet a return
    for (int k = 0; k < 500; ++k) apply(filter, {0, 0});
    EXPECT_NEAR(out[0], -side * 0.5 * 200 * 0.05, 1e-9);
    for (int k = 0; k < 1000; ++k) apply(filter, {0, 0});
    EXPECT_NEAR(out[0], -side * 200 * 0.05, 1e-9);
    qd[0] = side * 0.02;
    apply(filter, {0, 0});
    EXPECT_NEAR(out[0], -side * 200 * 0.07, 1e-9);
    qd[0] = side * 0.9;  // no harder than the repulsion at the limit
    apply(filter, {0, 0});
    EXPECT_NEAR(out[0], -side * 20, 1e-9);
    qd[0] = side * -0.9;
    apply(filter, {0, 0});
    EXPECT_NEAR(out[0], side * 20, 1e-9);
    qd.setZero();
    returns = false;
    apply(filter, {0, 0});
    apply(filter, {0, 0});
    EXPECT_NEAR(out[0], 0, 1e-12);
    returns = true;  // from zero again
    apply(filter, {0, 0});
    EXPECT_NEAR(out[0], 0, 1e-12);
    for (int k = 0; k < 500; ++k) apply(filter, {0, 0});
    q[0] = 0;
    apply(filter, {0, 0});
    q[0] = side * 1.01;
    apply(filter, {0, 0});
    EXPECT_NEAR(out[0], 0, 1e-12);
    for (int k = 0; k < 500; ++k) apply(filter, {0, 0});
    filter.restart();
    apply(filter, {0, 0});
    EXPECT_NEAR(out[0], 0, 1e-12);
  }
}

TEST_F(Filter, RampsToZeroIn100Ticks) {
  SafetyFilter filter = make();
  filter.reset(Pair(30, -5));
  for (int k = 1; k <= 100; ++k) {
    EXPECT_TRUE(near(ramp(filter), (1 - 0.01 * k) * Pair(30, -5), 1e-9)) << k;
  }
  EXPECT_EQ(filter.last(), Pair(0, 0));
  EXPECT_EQ(ramp(filter), Pair(0, 0));
}

/// A ramp goes by the torque at its own beginning, not at that of the ramp before.
TEST_F(Filter, RampsAnewAfterAGoodTick) {
  SafetyFilter filter = make();
  filter.reset(Pair(3, 0.5));
  ramp(filter);
  ASSERT_EQ(apply(filter, {30, -5}), Status::kOk);
  for (int k = 1; k <= 50; ++k) ramp(filter);
  EXPECT_TRUE(near(filter.last(), Pair(15, -2.5), 1e-9));
  filter.reset(Pair(20, 4));
  ramp(filter);
  EXPECT_TRUE(near(filter.last(), Pair(19.8, 3.96), 1e-9));
}

TEST_F(Filter, RampsDownWhatIsNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  SafetyFilter filter = make();
  filter.reset(Pair(30, -5));
  EXPECT_EQ(apply(filter, {0, nan}), Status::kNotFinite);
  EXPECT_TRUE(near(out, 0.99 * Pair(30, -5), 1e-9));
  EXPECT_EQ(apply(filter, {nan, 0}), Status::kNotFinite);
  EXPECT_TRUE(near(out, 0.98 * Pair(30, -5), 1e-9));
  EXPECT_TRUE(std::isnan(filter.asked()[0]));
}

/// A filter that knows nothing starts from the weight, unless it has put out something.
TEST_F(Filter, AssumesTheWeightWhereNothingIsKnown) {
  settings.limits.torque_rate.setConstant(1000);
  weight = {15, -3};
  SafetyFilter filter = make();
  filter.assume(weight);
  EXPECT_EQ(apply(filter, weight), Status::kOk);
  EXPECT_EQ(out, weight);
  filter.assume(Pair(20, -3));  // it is known by now
  EXPECT_EQ(filter.last(), weight);
  filter = make();
  EXPECT_EQ(ramp(filter), Pair(0, 0));
  filter.assume(weight);
  EXPECT_EQ(apply(filter, weight), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(1, -0.2), 1e-9));
  filter = make();
  filter.reset(Pair(50, -20));  // no more than the limits
  EXPECT_EQ(filter.last(), Pair(40, -10));
}

/// What the last torque has beyond the new one fades in all joints alike, as fast as the slowest
/// allows.
TEST_F(Filter, FadesEvenly) {
  settings.limits.torque_rate = Pair(1000, 500);
  SafetyFilter filter = make();
  filter.reset(Pair(20, 4));
  for (int k = 1; k <= 20; ++k) {
    EXPECT_EQ(apply(filter, {0, 0}), k < 20 ? Status::kTorqueLimited : Status::kOk);
    EXPECT_TRUE(near(out, (1 - 0.05 * k) * Pair(20, 4), 1e-9)) << k;
  }
  filter.begin_anew();
  springs = false;
  for (int k = 1; k <= 20; ++k) {
    apply(filter, {2, -80});  // of which 10 N m are within the limit, and count
    EXPECT_TRUE(near(out, 0.05 * k * Pair(2, -10), 1e-9)) << k;
  }
  springs = true;
  // Without a new beginning each joint changes as fast as it may.
  filter.reset(Pair(0, 0));
  apply(filter, {0, 0});
  EXPECT_EQ(apply(filter, {4, -4}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(1, -0.5), 1e-9));
  apply(filter, {0.5, -4});
  EXPECT_TRUE(near(out, Pair(0.5, -1), 1e-9));
}

/// However what is asked for changes while the torque fades, each torque goes toward it.
TEST_F(Filter, FadesTowardWhatIsAskedForNow) {
  settings.limits.torque_rate = Pair(1000, 500);
  SafetyFilter filter = make();
  filter.reset(Pair(20, 4));
  const auto seed =
      static_cast<std::uint64_t>(::testing::UnitTest::GetInstance()->random_seed()) + 1;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(-60, 60);
  Pair asked(0, 0);
  springs = false;  // which would shrink what is asked for
  for (int k = 0; k < 2000; ++k) {
    if (k % 50 == 0) filter.begin_anew();
    if (k % 7 == 0) asked = Pair(uniform(engine), uniform(engine) / 4);
    const JointVector last = filter.last();
    apply(filter, asked);
    for (int i = 0; i < 2; ++i) {
      EXPECT_LE(out[i], std::max(last[i], asked[i]) + 1e-12) << k;
      EXPECT_GE(out[i], std::min(last[i], asked[i]) - 1e-12) << k;
    }
  }
}

/// What drives a joint that is too fast waits for no other joint.
TEST_F(Filter, LetsGoAtOnceOfAJointThatIsTooFast) {
  settings.limits.torque_rate = Pair(1000, 500);
  SafetyFilter filter = make();
  filter.reset(Pair(20, 4));
  qd = {1.5, 3};
  springs = false;
  apply(filter, {0, 0});
  EXPECT_TRUE(near(out, Pair(19, 3.5), 1e-9));
  qd = {1.5, -3};  // is braked
  apply(filter, {0, 0});
  EXPECT_TRUE(near(out, Pair(18, 3.5 * 18 / 19), 1e-9));
}

/// Springs end while the repulsion brakes a joint that moves in from its limit. The end of the
/// repulsion is no reason to drive the joint on.
TEST_F(Filter, DrivesNoJointOnWhenItLeavesALimit) {
  settings.limits.torque_rate = Pair(1000, 1000);
  weight = {5, 0};
  SafetyFilter filter = make();
  filter.reset(weight);
  qd = {-1, 0};
  springs = false;
  for (int k = 0; k < 300; ++k) {
    q = {0.9 - 0.001 * k, 0};  // leaves the margin of 0.125 after 25 ticks
    apply(filter, weight - 2 * qd);
    EXPECT_GE(out[0], weight[0]) << k;
  }
  EXPECT_EQ(out[0], 7);
}

/// What it adds to matrices that are there already.
TEST_F(Filter, TellsTheModesOfItsRepulsion) {
  const SafetyFilter filter = make();
  const auto expect = [&](const Pair& where, bool with_springs, const Pair& stiffness,
                          const Pair& damping) {
    JointMatrix K = JointMatrix::Constant(2, 2, 5), C = JointMatrix::Constant(2, 2, 3);
    filter.add_repulsion(where, with_springs, K, C);
    EXPECT_TRUE(
        near(K - JointMatrix::Constant(2, 2, 5), Eigen::Matrix2d(stiffness.asDiagonal()), 1e-9));
    EXPECT_TRUE(
        near(C - JointMatrix::Constant(2, 2, 3), Eigen::Matrix2d(damping.asDiagonal()), 1e-9));
    EXPECT_EQ(filter.repels(where), damping != Pair(0, 0));
  };
  expect({0.875, -1.75}, true, {0, 0}, {0, 0});
  expect({0.9375, 0}, true, {2 * 20 * 0.5 / 0.125, 0}, {100, 0});
  expect({0, -1.9375}, false, {0, 0}, {0, 0.03});
  expect({1, -2.1}, true, {320, 0}, damper);  // outside no spring acts
}

TEST_F(Filter, KnowsWhatDampingTheLoopBears) {
  EXPECT_TRUE(near(make().borne(Pair(30, 30)), Pair(30, 2.5 * 0.04), 1e-12));
}

}  // namespace
}  // namespace dashpot::controller
