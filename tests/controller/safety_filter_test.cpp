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

class Filter : public ::testing::Test {
 protected:
  Filter() {
    const auto pair = [](double a, double b) { return JointVector(Pair(a, b)); };
    settings.limits.torque = pair(40, 10);
    settings.limits.torque_rate = pair(1e6, 1e6);
    settings.limits.velocity = pair(1e6, 1e6);  // the brake has nothing to do
    settings.limits.tip_velocity = 1.5;
    settings.limits.position_lower = pair(-1e9, -1e9);
    settings.limits.position_upper = pair(1e9, 1e9);
    robot.M = Eigen::Matrix2d(Pair(0.5, 0.1).asDiagonal());
    robot.coriolis = pair(0, 0);
  }
  SafetyFilter make() const { return SafetyFilter(settings); }
  /// Returns the output of the filter for `tau`.
  Status apply(SafetyFilter& filter, const Pair& tau) {
    out = tau;
    const JointVector position = q, velocity = qd, held = weight, damps = dampers;
    return filter.apply({position, velocity, robot, held, nullptr}, tip_speed, aim, damps, out);
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
  DynamicsResult robot;
  Pair q = Pair::Zero(), qd = Pair::Zero(), weight = Pair::Zero(), dampers = Pair::Zero();
  JointVector out;
  double tip_speed = 0;
  SafetyFilter::Aim aim = SafetyFilter::Aim::kSprings;
};

/// A joint whose weight is about at its limit keeps 5 % of the limit, which say how much all
/// joints shrink.
TEST_F(Filter, ShrinksAllJointsAlikeBeyondTheWeight) {
  weight = {39, 0};
  EXPECT_EQ(apply({49, 4}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(40, 4 * 0.2), 1e-12));  // 2 N m of 10
  EXPECT_EQ(apply({29, 4}), Status::kOk);            // away from the limit there is room
  EXPECT_TRUE(near(out, Pair(29, 4), 1e-12));
  EXPECT_EQ(apply({-139, 4}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(39 - 0.8 * 79, 4 * 0.8 * 79 / 178), 1e-12));
  weight = {30, 0};
  EXPECT_EQ(apply({50, 20}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(38, 8), 1e-12));
  EXPECT_EQ(apply({50, 25}), Status::kTorqueLimited);  // the other joint shrinks it most
  EXPECT_TRUE(near(out, Pair(30 + 20 * 0.32, 8), 1e-12));
  weight = {-50, 0};
  EXPECT_EQ(apply({-60, 4}), Status::kWeightNotHeld);
  EXPECT_TRUE(near(out, Pair(-40, 4 * 0.2), 1e-12));
  weight = {40, -10};
  EXPECT_EQ(apply(weight), Status::kOk);
}

/// Springs use 0.8 of the torque beside the weight, so that dampers always have some, and shrink no
/// damper.
TEST_F(Filter, LetsDampersGoFirst) {
  dampers = {-5, 6};
  EXPECT_EQ(apply(Pair(95, 3) + dampers), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(-5, 6) + 32.0 / 95 * Pair(95, 3), 1e-12));
  dampers = {0, 20};  // more than the limits allow
  EXPECT_EQ(apply(Pair(8, 0) + dampers), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(8, 10), 1e-12));
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
    EXPECT_EQ(apply({-30, 5}), Status::kOk);  // takes more energy than it gives
    EXPECT_TRUE(near(out, Pair(-30, 5), 1e-12));
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

/// A ramp depends on the torque at its own beginning, not at the beginning of the last ramp.
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

/// A NaN of the law leaves the weight, and a NaN of the weight leaves the ramp.
TEST_F(Filter, RampsDownWhatIsNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  SafetyFilter filter = make();
  filter.reset(Pair(30, -5));
  EXPECT_EQ(apply(filter, {0, nan}), Status::kNotFinite);
  EXPECT_TRUE(near(out, weight, 1e-9));
  filter.reset(Pair(30, -5));
  weight[0] = nan;
  EXPECT_EQ(apply(filter, {nan, 0}), Status::kNotFinite);
  EXPECT_TRUE(near(out, 0.99 * Pair(30, -5), 1e-9));
  EXPECT_TRUE(std::isnan(filter.asked()[0]));
}

/// A filter without information starts from the weight, unless it has put out a torque.
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

/// The part of the last torque beyond the new one fades in all joints alike, as fast as the slowest
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
  for (int k = 1; k <= 16; ++k) {
    apply(filter, {2, -80});  // of which a tenth remains
    EXPECT_TRUE(near(out, k / 16.0 * Pair(0.2, -8), 1e-9)) << k;
  }
  // Without a new beginning each joint changes as fast as it may.
  filter.reset(Pair(0, 0));
  apply(filter, {0, 0});
  EXPECT_EQ(apply(filter, {4, -4}), Status::kTorqueLimited);
  EXPECT_TRUE(near(out, Pair(1, -0.5), 1e-9));
  apply(filter, {0.5, -4});
  EXPECT_TRUE(near(out, Pair(0.5, -1), 1e-9));
}

/// However the requested torque changes during the fade, each torque goes toward it.
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
  for (int k = 0; k < 2000; ++k) {
    if (k % 50 == 0) filter.begin_anew();
    if (k % 7 == 0) asked = Pair(uniform(engine) / 2, uniform(engine) / 8);
    const JointVector last = filter.last();
    apply(filter, asked);
    for (int i = 0; i < 2; ++i) {
      EXPECT_LE(out[i], std::max(last[i], asked[i]) + 1e-12) << k;
      EXPECT_GE(out[i], std::min(last[i], asked[i]) - 1e-12) << k;
    }
  }
}

/// When the arm is to stop, torque that drives a moving joint waits for no other joint.
TEST_F(Filter, LetsGoAtOnceOfAJointThatMoves) {
  settings.limits.torque_rate = Pair(1000, 500);
  settings.limits.velocity = Pair(2, 3);
  robot.M.setZero();  // nothing to brake
  SafetyFilter filter = make();
  filter.reset(Pair(20, 4));
  aim = SafetyFilter::Aim::kStop;
  qd = {0.01, 0.3};
  apply(filter, weight);
  EXPECT_TRUE(near(out, Pair(19, 3.5), 1e-9));
  qd = {0.01, -0.3};  // is braked
  apply(filter, weight);
  EXPECT_TRUE(near(out, Pair(18, 3.5 * 18 / 19), 1e-9));
}

}  // namespace
}  // namespace dashpot::controller
