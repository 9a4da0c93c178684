// Moving average, ramp and one step of a path, each against its definition.
#include <dashpot/controller/law/gain_blend.hpp>
#include <dashpot/controller/motion/smooth_motion.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace dashpot::controller {
namespace {

using testing::near;
using testing::Random;

constexpr double kTick = 0.002;

TEST(Smoothing, IsTheMeanOfTheLastVelocities) {
  Random random(351);
  for (const int asked : {-1, 0, 1, 2, 7, 256, 1000}) {
    const int window = std::clamp(asked, 1, 256);
    Smoothing<JointVector> smoothing(asked, 3);
    for (int again = 0; again < 2; ++again) {  // and after a reset in motion
      if (again == 1) smoothing.reset();
      EXPECT_TRUE(smoothing.velocity().isZero(0));
      EXPECT_TRUE(smoothing.acceleration().isZero(0));
      EXPECT_TRUE(smoothing.offset().isZero(0));
      std::vector<JointVector> v(static_cast<std::size_t>(window), JointVector::Zero(3));
      JointVector mean_before = JointVector::Zero(3), offset = JointVector::Zero(3);
      for (int k = 0; k < 3 * window; ++k) {
        v.emplace_back(random.vector(3));
        smoothing.step(v.back(), kTick);
        JointVector mean = JointVector::Zero(3);
        for (auto one = v.end() - window; one != v.end(); ++one) mean += *one / window;
        offset += (mean - v.back()) * kTick;
        EXPECT_TRUE(near(smoothing.velocity(), mean, 1e-13));
        EXPECT_TRUE(near(smoothing.acceleration(), (mean - mean_before) / kTick, 1e-10));
        EXPECT_TRUE(near(smoothing.offset(), offset, 1e-12));
        mean_before = mean;
      }
      for (int k = 0; k < window; ++k) {
        EXPECT_FALSE(smoothing.velocity().isZero(0));
        smoothing.step(JointVector::Zero(3), kTick);
      }
      EXPECT_TRUE(smoothing.velocity().isZero(0));
      EXPECT_TRUE(smoothing.offset().isZero(0));
      smoothing.step(JointVector::Ones(3), kTick);  // still in motion when it is reset
    }
  }
}

TEST(Smoothing, MovesAsLongAsOneCoordinateDoes) {
  for (int i = 0; i < 3; ++i) {
    Smoothing<JointVector> smoothing(10, 3);
    for (int k = 0; k < 30; ++k) smoothing.step(JointVector::Unit(3, i), kTick);
    EXPECT_TRUE(near(smoothing.velocity(), JointVector::Unit(3, i), 1e-12));
  }
}

// At rest all rounding errors are gone: the next motion equals a new one's to the last bit.
TEST(Smoothing, KeepsNothingOfAMotionThatHasEnded) {
  Random random(352);
  Smoothing<JointVector> used(10, 3), fresh(10, 3);
  for (int k = 0; k < 1000; ++k) used.step(random.vector(3), kTick);
  for (int k = 0; k < 10; ++k) used.step(JointVector::Zero(3), kTick);
  for (int k = 0; k < 30; ++k) {
    const JointVector v = random.vector(3);
    used.step(v, kTick);
    fresh.step(v, kTick);
    EXPECT_EQ(used.velocity(), fresh.velocity());
    EXPECT_EQ(used.offset(), fresh.offset());
  }
}

TEST(Ramp, SetsOutFromWhereItIs) {
  Ramp<Vector6> ramp(10, Vector6::Zero());
  const Vector6 zero = Vector6::Zero(), one = Vector6::Ones();
  ramp.start(zero);
  ramp.set_target(one);
  for (int k = 0; k < 5; ++k) ramp.step();
  ramp.set_target(zero);
  for (int k = 1; k <= 10; ++k) {
    ramp.step();
    EXPECT_TRUE(near(ramp.now(), (0.5 - 0.05 * k) * one, 1e-12));
  }
  ramp.set_target(one);
  ramp.step();
  ramp.start(3 * one);  // on its way
  const auto changes = ramp.changes();
  ramp.step();
  EXPECT_EQ(ramp.now(), 3 * one);
  EXPECT_EQ(ramp.changes(), changes);
}

TEST(Ramp, TakesItsTicksEvenlyAndEndsExactly) {
  for (const int ticks : {-3, 0, 1, 2, 3, 10, 77, 1000}) {
    const int length = std::max(1, ticks);
    Ramp<Vector6> ramp(ticks, Vector6::Zero());
    const Vector6 from = Vector6::Constant(0.3), to = Vector6::Constant(-1.7);
    ramp.start(from);
    const auto changes = ramp.changes();
    EXPECT_EQ(ramp.now(), from);
    EXPECT_EQ(ramp.target(), from);
    ramp.step();
    EXPECT_EQ(ramp.changes(), changes);  // at rest
    ramp.set_target(to);
    EXPECT_EQ(ramp.now(), from);
    EXPECT_EQ(ramp.target(), to);
    for (int k = 1; k <= length; ++k) {
      ramp.step();
      EXPECT_TRUE(near(ramp.now(), from + (to - from) * k / length, 1e-12));
      EXPECT_EQ(ramp.now() == to, k == length);
      EXPECT_EQ(ramp.changes(), changes + static_cast<std::uint64_t>(k));
    }
    ramp.step();
    EXPECT_EQ(ramp.now(), to);
    EXPECT_EQ(ramp.changes(), changes + static_cast<std::uint64_t>(length));
    ramp.start(from);
    EXPECT_EQ(ramp.now(), from);
    EXPECT_GT(ramp.changes(), changes + static_cast<std::uint64_t>(length));
  }
}

/// Norm of the one coordinate's limits: velocity 2, acceleration 5.
JointNorm one_joint() {
  return {JointVector::Constant(1, 2.0), JointVector::Constant(1, 5.0)};
}
struct Step {
  double velocity;
  bool arrives;
};
Step one_step(double d, double v) {
  JointVector velocity = JointVector::Constant(1, v);
  const bool arrives =
      approach<JointVector>(JointVector::Constant(1, d), velocity, one_joint(), kTick);
  return {velocity[0], arrives};
}

TEST(Approach, EndsWithinATickWhereItCan) {
  // A possible speed of d / T, and half the acceleration limit to brake: d <= a T^2/2
  const double farthest = 0.5 * 5 * kTick * kTick;
  for (const double share : {-0.999, 0.5, 0.999}) {
    const auto step = one_step(share * farthest, 0);
    EXPECT_TRUE(step.arrives) << share;
    EXPECT_DOUBLE_EQ(step.velocity, share * farthest / kTick);
  }
  for (const double share : {-1.001, 1.001, 3.0}) {
    EXPECT_FALSE(one_step(share * farthest, 0).arrives) << share;
  }
  EXPECT_TRUE(one_step(0, 0).arrives);
  EXPECT_TRUE(one_step(0, 0.99 * 5 * kTick).arrives);
  EXPECT_FALSE(one_step(0, 1.01 * 5 * kTick).arrives);
}

TEST(Approach, SpeedsUpAtItsLimitAndBrakesAtHalfOfIt) {
  EXPECT_DOUBLE_EQ(one_step(100, 0).velocity, 5 * kTick);
  EXPECT_DOUBLE_EQ(one_step(-100, 0).velocity, -5 * kTick);
  EXPECT_DOUBLE_EQ(one_step(100, 2).velocity, 2);
  EXPECT_NEAR(one_step(-100, 2).velocity, 2 - 5 * kTick, 1e-15);
  // With k periods to go it has slowed down to k times the braking of one period.
  const double braking = 0.5 * 5 * kTick;
  for (const int k : {1, 2, 3, 10, 100}) {
    const double d = braking * kTick * k * (k + 1) / 2;
    const auto step = one_step(d * (1 - 1e-12), braking * (k + 1));
    EXPECT_NEAR(step.velocity, braking * k, 1e-9);
    EXPECT_EQ(step.arrives, k == 1);
  }
}

TEST(TwistNorm, TakesTheLargerShareOfItsTwoParts) {
  EXPECT_DOUBLE_EQ(TwistNorm{}.speed(3 * Vector6::Unit(1)), 3);
  EXPECT_DOUBLE_EQ(TwistNorm{}.speed(3 * Vector6::Unit(4)), 3);
  EXPECT_DOUBLE_EQ(TwistNorm{}.effort(3 * Vector6::Unit(2)), 3);
  EXPECT_DOUBLE_EQ(TwistNorm{}.effort(3 * Vector6::Unit(5)), 3);
  const TwistNorm norm{2, 4, 5, 10};
  Vector6 twist;
  twist << 0, 3, 4, 0, 0, 0;
  EXPECT_DOUBLE_EQ(norm.speed(twist), 2.5);
  EXPECT_DOUBLE_EQ(norm.effort(twist), 1);
  twist << 0, 0, 0, 6, 8, 0;
  EXPECT_DOUBLE_EQ(norm.speed(twist), 2.5);
  EXPECT_DOUBLE_EQ(norm.effort(twist), 1);
  twist << 1, 0, 0, 0, 0, -8;
  EXPECT_DOUBLE_EQ(norm.speed(twist), 2);
  EXPECT_DOUBLE_EQ(norm.effort(twist), 0.8);
}

TEST(JointNorm, TakesTheLargestShare) {
  const JointNorm norm{Eigen::Vector3d(1, 2, 4), Eigen::Vector3d(10, 10, 1)};
  EXPECT_DOUBLE_EQ(norm.speed(Eigen::Vector3d(0.5, -3, 4)), 1.5);
  EXPECT_DOUBLE_EQ(norm.effort(Eigen::Vector3d(0.5, -3, 4)), 4);
}

}  // namespace
}  // namespace dashpot::controller
