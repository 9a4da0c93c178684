// Sampled loops whose controllers have states of their own, such as integrals.
#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_impedance.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using testing::one_joint;
using testing::Random;

/// The integral of all springs, of which `factor` is W with K = W' W: w_k+1 = w_k + T W q_k, and
/// W' w / time.
ControllerMemory integral(const MatrixXd& factor, double period, double time) {
  const Index m = factor.rows();
  return {MatrixXd::Identity(m, m), period * factor, factor.transpose() / time};
}

std::vector<Complex> all_multipliers(const SampledSpectrum& sampled) {
  std::vector<Complex> all = sampled.others;
  all.insert(all.end(), sampled.memory.begin(), sampled.memory.end());
  for (const SampledMode& mode : sampled.modes) {
    all.insert(all.end(), mode.discrete_eigenvalues.begin(), mode.discrete_eigenvalues.end());
  }
  return all;
}

/// The characteristic equation of SampledLoop.SolvesTheCharacteristicEquation, in which K has
/// another term  output (z - state)^-1 position.
TEST(ControllerMemory, IsInTheCharacteristicEquation) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Index n = random.integer(1, 5), m = random.integer(1, 6);
    System<> system(n);
    system.mass = random.spd(n);
    system.stiffness = 1000 * random.spd(n);
    system.damping = random.log_uniform(1, 10) * random.spd(n);
    SampledLoop loop;
    loop.period = random.log_uniform(5e-4, 5e-3);
    loop.delay = random.integer(0, 3);
    loop.torque_cutoff = random.integer(0, 1) * random.log_uniform(50, 500);
    loop.difference_velocity = random.integer(0, 1) == 1;
    loop.memory.state = random.matrix(m, m) / static_cast<double>(m);
    loop.memory.position = random.matrix(m, n);
    loop.memory.output = 100 * random.matrix(n, m);
    const SampledSpectrum sampled = sample_loop(system, analyze(system), loop);
    const std::vector<Complex> all = all_multipliers(sampled);
    const Index memory =
        loop.delay + (loop.torque_cutoff > 0 ? 1 : 0) + (loop.difference_velocity ? 1 : 0);
    EXPECT_EQ(static_cast<Index>(all.size()), (2 + memory) * n + m);
    const double T = loop.period;
    const double a = std::exp(-2 * std::numbers::pi * loop.torque_cutoff * T);
    double largest = 0;
    for (const Complex z : all) {
      largest = std::max(largest, modulus(z));
      if (modulus(z) < 0.1) continue;  // of high multiplicity
      const Complex filter = loop.torque_cutoff > 0 ? (1 - a) * z / (z - a) : 1;
      const Complex damping = T * (loop.difference_velocity ? (z * z - 1.0) / (2.0 * z) : z - 1.0);
      const MatrixXcd step = z * MatrixXd::Identity(m, m) - loop.memory.state;
      const MatrixXcd stored =
          loop.memory.output * step.partialPivLu().solve(MatrixXcd(loop.memory.position));
      const MatrixXcd P = (z - 1.0) * (z - 1.0) * std::pow(z, loop.delay) / filter * system.mass +
                          T * T * (z + 1.0) / 2.0 * (system.stiffness + stored) +
                          damping * system.damping;
      const auto values = Eigen::JacobiSVD<MatrixXcd>(P).singularValues();
      EXPECT_LT(values[n - 1], 1e-9 * system.mass.norm() + 1e-7 * values[0]) << z;
    }
    EXPECT_NEAR(sampled.spectral_radius, largest, 1e-13);
  }
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
    EXPECT_EQ(all_multipliers(sample_loop(system, spectrum, loop)).size(), 20u);
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
      EXPECT_NEAR(margin, 2 * 2 / (loop.period * 10), 40);  // that of the damper
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
  const auto refused = [&](const ControllerMemory& memory) -> std::string {
    try {
      sample_loop(system, analyze(system), {.memory = memory});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
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
