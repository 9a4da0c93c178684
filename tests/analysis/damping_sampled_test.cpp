// Damping that is designed for a sampled loop: it has the gain margin that it claims, with which
// loops settle and turn as loop_stability_test.cpp shows.
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_arms.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::Random;

/// A loop that the fastest mode of the arm tries.
LoopLimit random_limit(const TaskImpedance& arm, Random& random, int seed) {
  const double fastest = design_damping(arm, {}).spectrum.modes[0].natural_frequency;
  LoopLimit limit;
  limit.gain_margin = random.uniform(1.05, 2.5);
  limit.loop.period = random.log_uniform(0.1, 0.5) / fastest;
  limit.loop.delay = seed % 3;
  limit.loop.torque_cutoff =
      random.integer(0, 1) * random.log_uniform(0.1, 0.3) / limit.loop.period;
  limit.loop.difference_velocity = random.integer(0, 1) == 1;
  return limit;
}

TEST(DampingInLoop, HasTheMarginThatItClaims) {
  int kept = 0, lowered = 0, given_up = 0;
  for (int seed = 1; seed <= 24; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(static_cast<std::uint64_t>(seed));
    const int n = random.integer(2, 5);
    TaskImpedance arm = random_arm(random, n, random.integer(1, n));
    LoopLimit limit = random_limit(arm, random, seed);
    if (seed % 3 == 0) {
      arm.damping = testing::random_friction(random, n, 1);
      limit.loop.friction = *arm.damping;
    }
    const DampingTarget target = DampingTarget::constant(random.uniform(0.3, 2));
    const SampledDamping result = design_damping(arm, target, limit);
    if (!result.kept) {
      EXPECT_LT(result.gain_margin, limit.gain_margin);
      ++given_up;
      continue;
    }
    EXPECT_GE(result.gain_margin, limit.gain_margin);
    EXPECT_TRUE(result.sampled.stable());
    EXPECT_EQ(negative_eigenvalues(result.design.damping).size(), 0);
    ++(result.level < 1 ? lowered : kept);
    const double found = gain_margin(result.design.system, result.design.spectrum, limit.loop);
    EXPECT_LE(found, result.gain_margin);
    EXPECT_GE(found, (1 - 1e-6) * result.gain_margin);
  }
  std::printf("ratio kept %d times, lowered %d, given up %d\n", kept, lowered, given_up);
  EXPECT_GT(kept, 5);
  EXPECT_GT(lowered, 3);
  EXPECT_GT(given_up, 2);
}

/// With too many states to solve for each trial.
TEST(DampingInLoop, HoldsThroughManyTicksOfDelay) {
  Random random(6);
  const TaskImpedance arm = random_arm(random, 4, 3);
  LoopLimit limit;
  limit.loop.delay = 60;
  limit.loop.period = 0.2 / 60 / design_damping(arm, {}).spectrum.modes[0].natural_frequency;
  const SampledDamping result = design_damping(arm, DampingTarget::constant(3), limit);
  ASSERT_TRUE(result.kept);
  EXPECT_GT(result.level, 0.1);
  EXPECT_LT(result.level, 0.9);
  EXPECT_NEAR(result.gain_margin, 2, 1e-4);
}

TEST(DampingInLoop, LowersTheRatioNoFurtherThanItHasTo) {
  int lowered = 0;
  for (int seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(static_cast<std::uint64_t>(seed));
    const TaskImpedance arm = random_arm(random, 4, 3);
    const LoopLimit limit = random_limit(arm, random, seed);
    const SampledDamping result = design_damping(arm, DampingTarget::constant(1.2), limit);
    if (!result.kept || result.level == 1) continue;
    ++lowered;
    for (const Mode<>& mode : result.design.spectrum.modes) {
      EXPECT_NEAR(mode.damping_ratio, 1.2 * result.level, 1e-9);
    }
    ASSERT_EQ(result.design.misses.size(), 3U);
    for (const DampingMiss& miss : result.design.misses) {
      EXPECT_EQ(miss.reason, DampingMiss::Reason::kLoop);
      EXPECT_EQ(miss.wanted, 1.2);
    }
    for (double level = 1.0001 * result.level; level < 1; level *= 1.03) {
      const DampingDesign more = design_damping(arm, DampingTarget::constant(1.2 * level));
      EXPECT_LT(gain_margin(more.system, more.spectrum, limit.loop), limit.gain_margin) << level;
    }
  }
  EXPECT_GT(lowered, 8);
}

// Under a held force z^2 + (c T/m + k T^2/2m - 2) z + 1 - c T/m + k T^2/2m = 0: stable for
// k T / 2 < c < 2 m / T.
TEST(DampingInLoop, FindsTheBoundsOfASingleMass) {
  TaskImpedance mass;
  mass.mass = MatrixXd::Constant(1, 1, 2);
  mass.stiffness = MatrixXd::Constant(1, 1, 800);  // 20 rad/s
  LoopLimit limit;
  limit.loop.period = 0.02;
  limit.gain_margin = 1.5;
  const double largest = 2 * 2 / 0.02 / 1.5;                  // N s/m
  const double ratio = largest / (2 * std::sqrt(2 * 800.0));  // 1.667
  EXPECT_NEAR(design_damping(mass, DampingTarget::constant(3), limit).level, ratio / 3, 2e-6);
  EXPECT_EQ(design_damping(mass, DampingTarget::constant(0.99 * ratio), limit).level, 1);
  // k T / 2 = 8 N s/m is a ratio of 0.1: less is unstable, and nothing lower helps.
  const SampledDamping none = design_damping(mass, DampingTarget::constant(0.09), limit);
  EXPECT_FALSE(none.kept);
  EXPECT_LT(none.gain_margin, 1);
}

TEST(DampingInLoop, FindsAMarginThatOnlyFewRatiosKeep) {
  Random random(8);
  const TaskImpedance arm = random_arm(random, 4, 3);
  LoopLimit limit;
  limit.loop.delay = 2;
  double most = 0, best = 0;
  for (double level = 1; level > 0.01; level *= 0.998) {
    const DampingDesign design = design_damping(arm, DampingTarget::constant(level));
    const double margin = gain_margin(design.system, design.spectrum, limit.loop);
    if (margin > most) most = margin, best = level;
  }
  ASSERT_LT(best, 1);
  const DampingTarget target = DampingTarget::constant(best / 0.95);  // between grid points
  limit.gain_margin = 1e9;                                            // out of reach
  const SampledDamping none = design_damping(arm, target, limit);
  EXPECT_FALSE(none.kept);
  EXPECT_GE(none.gain_margin, most * (1 - 1e-4));
  limit.gain_margin = most * (1 - 1e-4);
  const SampledDamping narrow = design_damping(arm, target, limit);
  EXPECT_TRUE(narrow.kept);
  EXPECT_NEAR(narrow.level, 0.95, 0.01);
}

TEST(DampingInLoop, RefusesAMarginThatIsNone) {
  Random random(9);
  const TaskImpedance arm = random_arm(random, 3, 3);
  LoopLimit limit;
  limit.gain_margin = 0.9;
  EXPECT_THROW(design_damping(arm, {}, limit), std::invalid_argument);
  limit.gain_margin = std::nan("");
  EXPECT_THROW(design_damping(arm, {}, limit), std::invalid_argument);
  limit.gain_margin = 2;
  limit.loop.period = 0;
  EXPECT_THROW(design_damping(arm, {}, limit), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::analysis
