// Loops with a delay, solved as small nonlinear eigenproblems, beside the dense eigenproblem of all
// their memory.
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/analysis/sampled/small_problem.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_impedance.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using testing::Random;

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

struct DelayedCase {
  System<> system;
  Spectrum<> spectrum;
  SampledLoop loop;
};

/// A loop of 1 to 5 joints with 0 to 20 ticks of delay, by chance with a low-pass, differenced
/// velocities, friction, gravity, zero modes and integrals, whose damping suits the delay or not.
DelayedCase random_delayed_case(Random& random) {
  DelayedCase result;
  System<>& system = result.system;
  SampledLoop& loop = result.loop;
  const Index n = random.integer(1, 5);
  if (random.integer(0, 2) == 0) {
    system = to_joint_space(testing::random_impedance(random, n + 1, n));
  } else {
    system = System<>(n);
    system.mass = random.spd(n);
    system.stiffness = 1000 * random.spd(n);
    system.damping = random.log_uniform(3, 100) * random.spd(n);
  }
  const Index joints = system.dof();
  loop.delay = random.integer(0, 20);
  loop.difference_velocity = random.integer(0, 1) == 1;
  if (random.integer(0, 1) == 1) {
    loop.friction = random.log_uniform(0.1, 3) * random.spd(joints);
    system.damping += loop.friction;
    system.has_low_words = false;
  }
  if (random.integer(0, 2) == 0) {
    loop.gravity_gradient = random.log_uniform(1, 10) * (random.spd(joints) - random.spd(joints));
    loop.gravity_gradient += loop.gravity_gradient.transpose().eval();
  }
  result.spectrum = analyze(system);
  if (random.integer(0, 3) == 0) {
    MatrixXd& output = loop.memory.output;
    loop.memory.state = MatrixXd::Identity(joints, joints);
    loop.memory.velocity = MatrixXd::Zero(joints, joints);
    output = random.log_uniform(0.1, 1) * system.stiffness;
  }
  const double fastest =
      result.spectrum.modes.empty() ? 1 : result.spectrum.modes[0].natural_frequency;
  loop.period = random.log_uniform(0.003, 0.6) / fastest / (1 + 0.3 * loop.delay);
  if (random.integer(0, 1) == 1) loop.torque_cutoff = random.log_uniform(0.01, 0.3) / loop.period;
  if (loop.memory.output.size() > 0)
    loop.memory.position = loop.period * MatrixXd::Identity(joints, joints);
  return result;
}

/// The largest |z| of the dense eigenproblem, without motions slower than `slowest` per tick.
double largest_modulus(const SampledDataModel& model, double factor, double slowest) {
  MatrixXd A = model.transition(factor);
  if (model.zero_modes.cols() > 0) {
    const MatrixXd rest = model.other_motions();
    A = (rest.transpose() * A * rest).eval();
  }
  double result = 0;
  for (const Complex z : eigenvalues_of(A)) {
    if (z != 0.0 && modulus(std::log(z)) < slowest) continue;
    result = std::max(result, modulus(z));
  }
  return result;
}

TEST(SmallProblem, HasTheGainMarginOfTheDenseOne) {
  int finite = 0, unstable = 0, hopeless = 0;
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const DelayedCase one = random_delayed_case(random);
    const double slowest = random.integer(0, 2) == 0 ? 0.01 / one.loop.period : 0;
    const double most = random.integer(0, 1) == 0 ? 1e6 : 2;
    const double margin = gain_margin(one.system, one.spectrum, one.loop, most, slowest);
    const SampledDataModel model(one.system, one.spectrum, one.loop);
    const double slow =
        std::max(one.loop.memory.state.size() > 0 ? 1e-4 : 1e-6, slowest * one.loop.period);
    const auto stable = [&](double factor) { return largest_modulus(model, factor, slow) < 1; };
    ++(margin == 0 ? hopeless : margin < 1 ? unstable : finite);
    if (margin == 0) {
      for (const double factor : {1.0, 0.3, 0.03, 2e-3}) EXPECT_FALSE(stable(factor)) << factor;
    } else if (margin == kNoLimit) {
      for (const double factor : {1.0, 0.5 + 0.5 * most, most})
        EXPECT_TRUE(stable(factor)) << factor;
    } else {
      EXPECT_TRUE(stable((1 - 1e-7) * margin)) << margin;
      EXPECT_FALSE(stable((1 + 1e-7) * margin)) << margin;
      for (const double share : {0.0, 0.3, 0.6, 0.9}) {
        EXPECT_EQ(stable(1 + share * (margin - 1)), margin > 1)
            << share << " of the way to " << margin;
      }
    }
  }
  std::printf("%d margins above 1, %d below, %d without\n", finite, unstable, hopeless);
}

TEST(SmallProblem, HasTheEigenvaluesOfTheDenseOne) {
  int refused = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const DelayedCase one = random_delayed_case(random);
    const SampledDataModel model(one.system, one.spectrum, one.loop);
    const Eigen::VectorXcd dense = model.discrete_eigenvalues();
    Eigen::VectorXcd small;
    try {
      small = roots_of_small_problem(model);
    } catch (const std::runtime_error&) {  // sample_loop takes the dense one then
      ++refused;
      continue;
    }
    ASSERT_EQ(small.size(), dense.size());
    for (const Complex z : dense) {
      if (modulus(z) < 0.3) continue;  // of high multiplicity
      double nearest = kNoLimit;
      for (const Complex other : small) nearest = std::min(nearest, modulus(z - other));
      EXPECT_LT(nearest, modulus(z - 1.0) < 1e-4 ? 1e-5 : 1e-7) << z;
    }
  }
  std::printf("%d of 60 loops not converged\n", refused);
  EXPECT_LE(refused, 8);
}

/// 10 joints, 6 directions, 100 ticks: 1,020 rows. The dense problem of this delay would take
/// minutes.
TEST(SmallProblem, DesignsForALongDelay) {
  Random random(40);
  TaskImpedance impedance = testing::random_impedance(random, 10, 6);
  impedance.damping = 0.1 * random.spd(10);
  LoopLimit limit;
  limit.loop.friction = *impedance.damping;
  for (const int delay : {0, 1, 20, 100}) {
    limit.loop.delay = delay;
    const double fastest = analyze(to_joint_space(impedance)).modes[0].natural_frequency;
    limit.loop.period = 0.4 / fastest / (1 + delay);
    const SampledDamping found = design_damping(impedance, DampingTarget::constant(1), limit);
    EXPECT_TRUE(found.kept);
    EXPECT_GE(found.gain_margin, 2) << delay;
    if (found.level < 1) {
      EXPECT_NEAR(found.gain_margin, 2, 1e-4) << delay;
    }
    EXPECT_TRUE(found.sampled.stable());
    const SampledDataModel model(found.design.system, found.design.spectrum, limit.loop);
    EXPECT_EQ(model.inner(), 20);
    Complex sum = static_cast<double>(model.unit_motions().cols());  // of all eigenvalues
    for (const Complex z : found.sampled.others) sum += z;
    for (const Complex z : found.sampled.zero_modes) sum += z;
    for (const SampledMode& mode : found.sampled.modes) {
      sum += mode.discrete_eigenvalues[0] + mode.discrete_eigenvalues[1];
    }
    EXPECT_LT(modulus(sum - model.transition().trace()), 1e-6);
  }
}

TEST(DampingFit, RefusesWhatTakesTooMuchMemory) {
  EXPECT_TRUE(DampingFit::fits(352, 16, 16, DampingStructure::kFull));
  EXPECT_TRUE(DampingFit::fits(1, 100, 70, DampingStructure::kFull));
  EXPECT_FALSE(DampingFit::fits(1, 300, 300, DampingStructure::kFull));
  EXPECT_FALSE(DampingFit::fits(32, 300, 300, DampingStructure::kDiagonal));
  TaskImpedance large;
  large.mass = MatrixXd::Identity(300, 300);
  large.stiffness = MatrixXd::Identity(300, 300);
  EXPECT_THROW(design_region(std::vector<TaskImpedance>(2, large), {}), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::analysis
