// Sampled loops whose controllers have states of their own, such as integrals; that these are in
// the characteristic equation is in sampled_loop_test.cpp.
#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_impedance.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/sampled_loops.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using testing::one_joint;
using testing::Random;

/// The integral of all springs, of which `factor` is W with K = W' W: w_k+1 = w_k + T W q_k, and
/// W' w / time.
ControllerMemory integral(const MatrixXd& factor, double period, double time) {
  const Index m = factor.rows();
  return {MatrixXd::Identity(m, m), period * factor, factor.transpose() / time};
}

/// Beside quick springs the torque of their integral decays as 1 - T / time per tick, also where
/// zero modes are left that nothing reads.
TEST(ControllerMemory, OfAnIntegralMakesSlowModes) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const System<> system = to_joint_space(testing::random_impedance(random, 7, 6));
    const Spectrum<> spectrum = analyze(system);
    ASSERT_EQ(spectrum.modes.size(), 6);
    double slowest = spectrum.modes[0].natural_frequency;
    for (const Mode<>& mode : spectrum.modes) {
      slowest = std::min(slowest, modulus(mode.eigenvalues[0]));
      slowest = std::min(slowest, modulus(mode.eigenvalues[1]));
    }
    SampledLoop loop;
    loop.period = 1e-2 / spectrum.modes[0].natural_frequency;
    const double time = 1e4 / slowest;
    loop.memory = integral(system.stiffness_factor, loop.period, time);
    const SampledSpectrum sampled = sample_loop(system, spectrum, loop);
    ASSERT_EQ(sampled.memory.size(), 6u);
    for (const Complex z : sampled.memory) {
      EXPECT_LT(modulus(std::log(z) / loop.period * time + 1.0), 1e-3) << z;  // 1 - z is 1e-8
    }
    EXPECT_TRUE(sampled.zero_modes.empty() && sampled.others.empty());
    EXPECT_TRUE(sampled.stable());
    loop.memory.position += 1e-3 * random.matrix(6, 7) * loop.memory.position.norm();
    EXPECT_EQ(testing::all_multipliers(sample_loop(system, spectrum, loop)).size(), 20u);
  }
}

/// M l^3 + s (C l^2 + K l + K / time) has no root with a positive real part for s > M / (C time).
TEST(ControllerMemory, BoundsTheGainMargin) {
  SampledLoop loop;
  loop.period = 1e-4;
  const System<> system = one_joint(2, 10, 400);  // M / C = 0.2 s
  const Spectrum<> spectrum = analyze(system);
  const MatrixXd factor = MatrixXd::Constant(1, 1, 20);
  for (const double time : {0.19, 0.21, 1.0}) {
    loop.memory = integral(factor, loop.period, time);
    const SampledSpectrum sampled = sample_loop(system, spectrum, loop);
    EXPECT_EQ(sampled.stable(), time > 0.2) << time;
    ASSERT_EQ(sampled.memory.size(), 1u);
    const double margin = gain_margin(system, spectrum, loop);
    if (time < 0.2) {
      EXPECT_EQ(margin, 0);  // lower gains only make it worse
    } else {
      EXPECT_NEAR(margin, 2 * 2 / (loop.period * 10), 40);  // the damper's margin
    }
  }
}

TEST(ControllerMemory, HasTheSameMarginInAnElasticForm) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const System<> system = to_joint_space(testing::random_impedance(random, 5, 3));
    const Spectrum<> spectrum = analyze(system);
    ElasticForm<> form;
    ASSERT_EQ(to_elastic_form(system, form), Status::kOk);
    SampledLoop loop;
    loop.period = 0.02 / spectrum.modes[0].natural_frequency;
    loop.delay = random.integer(0, 2);
    loop.memory = integral(system.stiffness_factor, loop.period,
                           random.log_uniform(1, 30) / spectrum.modes[2].natural_frequency);
    const double margin = gain_margin(system, spectrum, loop);
    const double same = gain_margin(form, loop);
    EXPECT_TRUE(same == margin || std::abs(same - margin) < 1e-5 * margin) << same << margin;
  }
}

TEST(ControllerMemory, OfOtherSizesIsRefused) {
  const System<> system = one_joint(1, 2, 3);
  const MatrixXd one = MatrixXd::Ones(1, 1);
  const auto refused = [&](const ControllerMemory& memory) {
    return testing::refusal<std::invalid_argument>(
        [&] { sample_loop(system, analyze(system), {.memory = memory}); });
  };
  EXPECT_EQ(refused({one, one, one}), "accepted");
  const std::string sizes = "sample_loop: memory has to be m x m, m x n and n x m";
  EXPECT_EQ(refused({one, MatrixXd::Ones(1, 2), one}), sizes);
  EXPECT_EQ(refused({one, one, MatrixXd::Ones(2, 1)}), sizes);
  EXPECT_EQ(refused({MatrixXd::Ones(1, 2), one, one}), sizes);
  EXPECT_EQ(refused({{}, one, {}}), sizes);
  EXPECT_EQ(refused({one, one, MatrixXd::Constant(1, 1, std::nan(""))}),
            "sample_loop: memory is not finite");
}

}  // namespace
}  // namespace dashpot::analysis
