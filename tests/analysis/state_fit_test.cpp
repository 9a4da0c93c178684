// Modes from motions that are known exactly: closed-form responses of random systems.
#include <dashpot/analysis/response.hpp>
#include <dashpot/tests/support/made_to_measure.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_impedance.hpp>
#include <dashpot/tests/support/state_fit.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::IdentifiedMode;
using testing::IdentifiedModes;
using testing::identify_modes;
using testing::Random;
using testing::Recording;

Recording record(const Response& response, const VectorXd& q, const VectorXd& v, double period,
                 int samples) {
  Recording recording{MatrixXd(q.size(), samples), MatrixXd(q.size(), samples)};
  for (int k = 0; k < samples; ++k) {
    const Motion motion = response.free(q, v, k * period);
    recording.position.col(k) = motion.position;
    recording.velocity.col(k) = motion.velocity;
  }
  return recording;
}

/// Releases of a system, at rest or in motion.
std::vector<Recording> releases(const System<>& system, const Spectrum<>& spectrum, Random& random,
                                int count, double period, int samples = 200) {
  const Response response(system, spectrum);
  std::vector<Recording> recordings;
  for (int k = 0; k < count; ++k) {
    const VectorXd q = random.vector(system.dof());
    const VectorXd v =
        k % 2 == 0 ? VectorXd::Zero(system.dof()) : VectorXd(10 * random.vector(system.dof()));
    recordings.push_back(record(response, q, v, period, samples));
  }
  return recordings;
}

System<> random_system(Random& random, Eigen::Index n, double damping) {
  System<> system(n);
  system.mass = random.spd(n);
  system.stiffness = 1000 * random.spd(n);
  system.damping = damping * random.spd(n);
  return system;
}

double fastest(const Spectrum<>& spectrum) {
  double result = 0;
  for (const Mode<>& mode : spectrum.modes) {
    result = std::max({result, modulus(mode.eigenvalues[0]), modulus(mode.eigenvalues[1])});
  }
  return result;
}

/// Modes of the fit that are not soft are those of the spectrum, which are ordered alike; errors
/// are within `tolerance` and within the estimates.
void expect_modes(const IdentifiedModes& fit, const Spectrum<>& spectrum, double tolerance) {
  int k = 0;
  for (const IdentifiedMode& mode : fit.modes) {
    if (mode.kind == ModeKind::kSoft) continue;
    ASSERT_LT(k, spectrum.modes.size());
    const Mode<>& truth = spectrum.modes[k++];
    EXPECT_NEAR(mode.natural_frequency, truth.natural_frequency,
                tolerance * truth.natural_frequency);
    EXPECT_NEAR(mode.damping_ratio, truth.damping_ratio, tolerance * (1 + truth.damping_ratio));
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_LE(modulus(mode.eigenvalues[i] - truth.eigenvalues[i]),
                mode.error + truth.error_bound);
    }
    EXPECT_LE(std::abs(mode.natural_frequency - truth.natural_frequency),
              mode.natural_frequency_error + truth.natural_frequency_bound);
    EXPECT_LE(std::abs(mode.damping_ratio - truth.damping_ratio),
              mode.damping_ratio_error + truth.damping_ratio_bound);
  }
  EXPECT_EQ(k, spectrum.modes.size());
}

/// Two overdamped modes can pair otherwise.
bool oscillates(const Spectrum<>& spectrum) {
  return std::all_of(spectrum.modes.begin(), spectrum.modes.end(),
                     [](const Mode<>& mode) { return mode.damping_ratio < 0.95; });
}

/// Frequencies, ratios and shapes; without a mass matrix, and at any stride.
TEST(StateFit, FindsTheModesOfRandomSystems) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(seed);
    const Eigen::Index n = random.integer(1, 7);
    const System<> system = random_system(random, n, random.log_uniform(0.1, 5));
    const Spectrum<> spectrum = analyze(system);
    if (!oscillates(spectrum)) continue;
    const double period = 0.1 / fastest(spectrum);
    const std::vector<Recording> recordings = releases(system, spectrum, random, 3, period);
    const IdentifiedModes fit = identify_modes(recordings, {.period = period, .mass = system.mass});
    EXPECT_EQ(fit.rank, 2 * n);
    EXPECT_TRUE(fit.unpaired.empty());
    EXPECT_LT(fit.residual, 1e-12);
    EXPECT_NEAR(fit.stride, 10, 1);  // 1 rad of the fastest
    expect_modes(fit, spectrum, 1e-8);
    for (int k = 0; k < spectrum.modes.size(); ++k) {
      const Eigen::VectorXcd& u = fit.modes[static_cast<std::size_t>(k)].shape;
      EXPECT_NEAR(std::abs(u.dot(spectrum.modes[k].shapes[0].normalized())), 1, 1e-8);
    }
    if (seed % 5 > 0) continue;
    for (const int stride : {1, 3, 8, 20}) {
      const IdentifiedModes other =
          identify_modes(recordings, {.period = period, .stride = stride});
      EXPECT_EQ(other.stride, stride);
      expect_modes(other, spectrum, 1e-6);
    }
  }
}

TEST(StateFit, PairsTheRealEigenvaluesOfOverdampedModes) {
  Random random(43);
  System<> system = random_system(random, 4, 0);
  const MatrixXd U = analyze(system).zero_modes.coordinates;  // U' M U = 1
  const MatrixXd per_U = U.inverse();
  const VectorXd omega{{40, 25, 15, 8}}, ratio{{0.2, 1.5, 3, 1.2}};
  system.stiffness = per_U.transpose() * omega.cwiseAbs2().asDiagonal() * per_U;
  system.damping = per_U.transpose() * (2 * ratio.cwiseProduct(omega)).asDiagonal() * per_U;
  system.stiffness = (0.5 * (system.stiffness + system.stiffness.transpose())).eval();
  system.damping = (0.5 * (system.damping + system.damping.transpose())).eval();
  const IdentifiedModes fit = identify_modes(releases(system, analyze(system), random, 3, 0.001),
                                             {.period = 0.001, .mass = system.mass});
  ASSERT_EQ(fit.modes.size(), 4u);
  for (int k = 0; k < 4; ++k) {
    const IdentifiedMode& mode = fit.modes[static_cast<std::size_t>(k)];
    EXPECT_NEAR(mode.natural_frequency, omega[k], 1e-7 * omega[k]);
    EXPECT_NEAR(mode.damping_ratio, ratio[k], 1e-7);
    EXPECT_EQ(mode.kind, ratio[k] > 1 ? ModeKind::kOverdamped : ModeKind::kUnderdamped);
  }
}

/// A redundant arm: the self-motion drifts to rest or on for ever, and stores nothing.
TEST(StateFit, TellsZeroModesFromTheRest) {
  for (const bool damped : {true, false}) {
    for (std::uint64_t seed = 50; seed < 60; ++seed) {
      Random random(seed);
      System<> system = to_joint_space(testing::random_impedance(random, 7, 6));
      if (damped) system.damping += MatrixXd(0.3 * MatrixXd::Identity(7, 7));
      const Spectrum<> spectrum = analyze(system);
      if (!oscillates(spectrum)) continue;
      const double period = 0.1 / fastest(spectrum);
      const IdentifiedModes fit =
          identify_modes(releases(system, spectrum, random, 4, period, 400),
                         {.period = period, .soft_frequency = 1e-3, .mass = system.mass});
      EXPECT_EQ(fit.rank, 14);
      ASSERT_EQ(fit.modes.size(), 7u);
      expect_modes(fit, spectrum, 1e-6);
      const IdentifiedMode& free = fit.modes.back();
      EXPECT_EQ(free.kind, ModeKind::kSoft);
      if (damped) {
        EXPECT_NEAR(free.eigenvalues[0].real(), 0, 1e-7);
        EXPECT_NEAR(free.eigenvalues[1].real(), spectrum.zero_mode_rates[0], 1e-7);
      }
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
