// How far gains may grow before a sampled loop is unstable, from eigenvalues and by counting them.
#include <dashpot/analysis/sampled/circle_count.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/sampled_loops.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::one_joint;
using testing::Random;

/// Without delay one joint is stable for T^2 K / 2 < T C and T C < 2 M.
TEST(GainMargin, IsThatOfOneJoint) {
  Random random(300);
  for (int i = 0; i < 20; ++i) {
    SampledLoop loop;
    loop.period = random.log_uniform(1e-4, 1e-2);
    const double M = random.log_uniform(0.1, 10);
    const double C = random.uniform(0.01, 5) * M / loop.period;
    const double K = random.uniform(0.01, 1.9) * C / loop.period;
    const System<> system = one_joint(M, C, K);
    const double expected = 2 * M / (loop.period * C);
    EXPECT_NEAR(gain_margin(system, analyze(system), loop), expected, 1e-5 * expected);
    EXPECT_EQ(testing::sample(system, loop).stable(), expected > 1);
  }
}

/// The first margin of several, with damping whose squares overflow.
TEST(GainMargin, IsTheFirstWhereAnEnergyIsNoNumber) {
  const double d = 1e158, T = 1e10;
  const MatrixXd unit = MatrixXd::Identity(2, 2);
  System<> system(2);
  system.damping = 1.001 * d / T * unit;
  system.stiffness = -d / T / T * MatrixXd{{0, 1}, {0.1, 0}};
  SampledLoop loop;
  loop.period = T;
  loop.friction = d / T * unit;
  loop.compensation = d / T / T * (MatrixXd{{0, -1}, {-0.8, 0}} - unit);
  EXPECT_NEAR(gain_margin(system, analyze(system), loop), 3.02, 0.01);
}

TEST(GainMargin, RefusesFrictionWhoseSumIsNoNumber) {
  System<> system(2);
  system.stiffness = system.damping = MatrixXd::Identity(2, 2);
  SampledLoop loop;
  loop.period = 1;
  loop.friction = MatrixXd::Constant(2, 2, 1e308);
  EXPECT_EQ(
      testing::refusal<std::invalid_argument>([&] { gain_margin(system, analyze(system), loop); }),
      "sample_loop: the friction is too large");
}

/// With much friction the margin follows from the criterion of Jury for z^2 - t z + d.
TEST(GainMargin, IsThatOfOneJointWithFriction) {
  Random random(301);
  int finite = 0;
  for (int i = 0; i < 50; ++i) {
    SampledLoop loop;
    const double T = loop.period = random.log_uniform(1e-4, 1e-2), M = random.log_uniform(0.1, 10);
    const double friction = random.uniform(0.2, 8), c = random.log_uniform(0.01, 3);
    const double k = random.log_uniform(0.001, 1);
    loop.friction = MatrixXd::Constant(1, 1, friction * M / T);
    const double a = std::exp(-friction), one = (1 - a) / friction;
    const double two = (friction - 1 + a) / (friction * friction);
    const double by_alternation = (1 + a) * two * k + 2 * one * c - one * one * k;
    const double by_oscillation = one * one * k - one * c - a * two * k;
    double expected = std::numeric_limits<double>::infinity();
    if (by_alternation > 0) expected = std::min(expected, 2 * (1 + a) / by_alternation);
    if (by_oscillation > 0) expected = std::min(expected, (1 - a) / by_oscillation);
    const System<> system = one_joint(M, (friction + c) * M / T, k * M / (T * T));
    const double found = gain_margin(system, analyze(system), loop);
    if (expected > 1e6) continue;
    EXPECT_NEAR(found, expected, 1e-5 * expected);
    ++finite;
  }
  EXPECT_GT(finite, 40);
}

/// A spring of the world that pushes away needs more stiffness, so that there is no margin.
TEST(GainMargin, IsZeroIfOnlyMoreHelps) {
  const System<> system = one_joint(1, 300, -1000);
  SampledLoop loop;
  loop.passive_stiffness = MatrixXd::Constant(1, 1, -3000);
  EXPECT_FALSE(testing::sample(system, loop).stable());
  EXPECT_EQ(gain_margin(system, analyze(system), loop), 0);
  const System<> stiffer = one_joint(1, 600, 1000);  // with twice the gains
  EXPECT_TRUE(testing::sample(stiffer, loop).stable());
}

TEST(GainMargin, IsZeroIfNothingHelpsAndInfiniteIfNothingHarms) {
  const System<> undamped = one_joint(1, 0, 100);
  EXPECT_EQ(gain_margin(undamped, analyze(undamped), {}), 0);
  SampledLoop passive;  // the friction is all there is
  passive.friction = MatrixXd::Constant(1, 1, 3);
  const System<> free = one_joint(1, 3, 0);
  EXPECT_EQ(gain_margin(free, analyze(free), passive), std::numeric_limits<double>::infinity());
}

TEST(GainMargin, IsWhereTheSpectralRadiusIsOne) {
  for (std::uint64_t seed = 310; seed < 330; ++seed) {
    Random random(seed);
    System<> system = testing::random_system(random, random.integer(1, 5));
    SampledLoop loop = testing::random_loop(random);
    loop.friction = 0.1 * system.damping;
    const double margin = gain_margin(system, analyze(system), loop);
    if (margin == 0 || !std::isfinite(margin)) continue;
    const System<> nominal = system;
    for (const double factor : {0.999 * margin, 1.001 * margin}) {
      system.stiffness = factor * nominal.stiffness;
      system.damping = loop.friction + factor * (nominal.damping - loop.friction);
      EXPECT_EQ(testing::sample(system, loop).stable(), factor < margin);
    }
  }
}

/// v_k+1 = v_k - a v_k-d is stable for 0 < a < 2 sin(pi / (2 (2 d + 1))) (Levin and May 1976).
TEST(GainMargin, OfADampedMassFallsWithTheDelay) {
  for (const int delay : {1, 20, 98, 99, 198, 199, 250, 2000}) {  // from 99 on by counting
    SampledLoop loop;
    loop.delay = delay;
    const double most = 2 * std::sin(std::numbers::pi / (2 * (2 * delay + 1)));
    for (const double share : {0.3, 4.0}) {
      if (share > 1 && delay > 250) continue;
      SCOPED_TRACE(std::to_string(delay) + " ticks, " + std::to_string(share));
      const System<> mass = one_joint(3, share * most * 3 / loop.period, 0);
      const Spectrum<> spectrum = analyze(mass);
      EXPECT_NEAR(gain_margin(mass, spectrum, loop), 1 / share, 1e-6);
      EXPECT_TRUE(keeps_margin(mass, spectrum, loop, 0.9999 / share));
      EXPECT_FALSE(keeps_margin(mass, spectrum, loop, 1.0002 / share));
      EXPECT_EQ(keeps_margin(mass, spectrum, loop, 1), share < 1);
      EXPECT_TRUE(keeps_margin(mass, spectrum, loop, 0));
    }
  }
}

/// With an integral a loop may be stable as it is and not with less.
TEST(GainMargin, BelowOneIsKeptByALoopThatIsStableAsItIs) {
  const System<> system = one_joint(1, 20, 100);
  SampledLoop loop;
  const MatrixXd one = MatrixXd::Identity(1, 1);
  loop.memory = {one, one, 1000 * loop.period * one};
  EXPECT_GT(gain_margin(system, analyze(system), loop), 10);
  EXPECT_TRUE(keeps_margin(system, analyze(system), loop, 1));
  EXPECT_TRUE(keeps_margin(system, analyze(system), loop, 0.3));
  const System<> less = one_joint(1, 0.3 * 20, 0.3 * 100);
  loop.memory.output *= 0.3;
  EXPECT_FALSE(keeps_margin(less, analyze(less), loop, 1));
}

TEST(GainMargin, IsNotAskedForBelowZero) {
  const System<> system = one_joint(1, 2, 3);
  SampledLoop wrong;
  wrong.period = -1;
  EXPECT_THROW(keeps_margin(system, analyze(system), wrong, 0), std::invalid_argument);
  EXPECT_THROW(keeps_margin(system, analyze(system), {}, -0.01), std::invalid_argument);
  EXPECT_THROW(keeps_margin(system, analyze(system), {}, std::nan("")), std::invalid_argument);
}

/// With all that a loop may have: friction, gravity, springs of the world, zero modes, an integral.
SampledLoop add_parts(Random& random, System<>& system, SampledLoop loop) {
  const Eigen::Index n = system.dof();
  if (random.integer(0, 1) == 1) {
    loop.friction = random.log_uniform(0.1, 3) * random.spd(n);
    system.damping += loop.friction;
  }
  if (random.integer(0, 2) == 0) loop.gravity_gradient = random.spd(n) - random.spd(n);
  if (random.integer(0, 2) == 0) loop.passive_stiffness = 0.1 * system.stiffness;
  if (random.integer(0, 2) == 0) {
    loop.memory = {MatrixXd::Identity(n, n), MatrixXd::Identity(n, n),
                   random.log_uniform(0.1, 3) * loop.period * system.stiffness};
  }
  return loop;
}

/// The largest |z| that a count takes in, by the eigenvalues of the whole state. What rests at 1
/// may be a double eigenvalue, which rounding errors move by the root of theirs.
double spectral_radius(const SampledDataModel& model, double factor) {
  MatrixXd A = model.on_other_motions(model.transition(factor));
  double radius = 0;
  for (const Complex z : eigenvalues_of(A)) {
    if (std::abs(z - 1.0) > 1e-5) radius = std::max(radius, std::abs(z));
  }
  return radius;
}

TEST(CircleCount, AgreesWithTheEigenvalues) {
  int stable = 0, unstable = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Random random(seed);
    System<> system = testing::random_system(random, random.integer(1, 5));
    SampledLoop loop = testing::random_loop(random);
    loop.delay = random.integer(0, 20);
    if (seed % 4 == 0) {  // leaves one direction free
      const MatrixXd factor = random.matrix(system.dof(), system.dof() - 1);
      system.stiffness = 1000 * factor * factor.transpose();
    }
    loop = add_parts(random, system, loop);
    const SampledDataModel model(system, analyze(system), loop);
    const CircleCount count(model, 0);
    for (const double factor : {0.01, 0.1, 0.5, 1.0, 2.0, 10.0}) {
      const double radius = spectral_radius(model, factor);
      if (std::abs(radius - 1) < 1e-8) continue;
      EXPECT_EQ(count.excess(factor) < 0, radius < 1) << radius - 1;
      ++(radius < 1 ? stable : unstable);
    }
  }
  EXPECT_GT(stable, 50);
  EXPECT_GT(unstable, 50);
}

/// Close to the boundary on either side, and several zeros crossing the circle in one place.
TEST(CircleCount, TellsTheSidesOfTheBoundary) {
  SampledLoop loop;
  loop.delay = 30;
  const double most = 2 * std::sin(std::numbers::pi / (2 * (2 * loop.delay + 1)));
  for (const Eigen::Index n : {1, 2, 6}) {
    System<> masses(n);
    masses.mass = MatrixXd::Identity(n, n);
    masses.damping = most / loop.period * MatrixXd::Identity(n, n);
    const CircleCount count(SampledDataModel(masses, analyze(masses), loop), 0);
    for (const double distance : {1e-1, 1e-3, 1e-5, 1e-7}) {
      EXPECT_LT(count.excess(1 - distance), 0) << n << ' ' << distance;
      EXPECT_GT(count.excess(1 + distance), 0) << n << ' ' << distance;
    }
    EXPECT_GT(count.excess(1), 0);
  }
}

/// A hill that a late compensation of gravity does not quite level is fallen from slowly.
TEST(CircleCount, LeavesSlowMotionsOut) {
  System<> system(2);
  system.mass = MatrixXd::Identity(2, 2);
  system.stiffness.diagonal() << 400, 0;
  system.damping.diagonal() << 20, 0;
  SampledLoop loop;
  loop.gravity_gradient = MatrixXd::Zero(2, 2);
  loop.gravity_gradient(1, 1) = -1;  // (1/s)^2
  loop.friction = MatrixXd::Zero(2, 2);
  system.stiffness(1, 1) = -1e-4;  // 0.01 1/s
  const Spectrum<> spectrum = analyze(system);
  const SampledDataModel model(system, spectrum, loop);
  EXPECT_GT(CircleCount(model, 0.005 * loop.period).excess(1), 0);
  EXPECT_LT(CircleCount(model, 0.05 * loop.period).excess(1), 0);
}

}  // namespace
}  // namespace dashpot::analysis
