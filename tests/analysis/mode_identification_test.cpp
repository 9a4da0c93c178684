// Modes from motions that are known exactly: closed-form responses of random systems.
#include <dashpot/analysis/mode_identification.hpp>
#include <dashpot/analysis/response.hpp>
#include <dashpot/tests/support/made_to_measure.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_impedance.hpp>
#include <dashpot/tests/support/refusal.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;

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
TEST(IdentifiedModes, FindsTheModesOfRandomSystems) {
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

TEST(IdentifiedModes, PairsTheRealEigenvaluesOfOverdampedModes) {
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

TEST(IdentifiedModes, FindsDefectiveModesToTheRootOfThePrecision) {
  Random random(44);
  System<> system(1);  // critically damped at 10 rad/s
  system.stiffness(0, 0) = 100;
  system.damping(0, 0) = 20;
  const IdentifiedModes fit =
      identify_modes(releases(system, analyze(system), random, 2, 0.01), {.period = 0.01});
  ASSERT_EQ(fit.modes.size(), 1u);
  EXPECT_NEAR(fit.modes[0].natural_frequency, 10, 1e-10);  // sum and product keep all digits
  EXPECT_NEAR(fit.modes[0].damping_ratio, 1, 1e-10);
  EXPECT_NEAR(modulus(fit.modes[0].eigenvalues[0] + 10.0), 0, 1e-5);
}

/// A redundant arm: the self-motion drifts to rest or on for ever, and stores nothing.
TEST(IdentifiedModes, TellsZeroModesFromTheRest) {
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

TEST(IdentifiedModes, FindsOnlyTheModesThatMove) {
  Random random(60);
  const System<> system = random_system(random, 4, 1);
  const Spectrum<> spectrum = analyze(system);
  const Response response(system, spectrum);
  const double period = 0.1 / fastest(spectrum);
  // The real part of u e^(lambda t), and another.
  std::vector<Recording> recordings;
  VectorXd q = VectorXd::Zero(4), v = q;
  for (const int k : {1, 3}) {
    const Mode<>& mode = spectrum.modes[k];
    q += mode.shapes[0].real();
    v += (mode.eigenvalues[0] * mode.shapes[0]).real();
  }
  recordings.push_back(record(response, q, v, period, 300));
  const IdentifiedModes fit = identify_modes(recordings, {.period = period, .mass = system.mass});
  EXPECT_EQ(fit.rank, 4);
  ASSERT_EQ(fit.modes.size(), 2u);
  EXPECT_NEAR(fit.modes[0].natural_frequency, spectrum.modes[1].natural_frequency, 1e-7);
  EXPECT_NEAR(fit.modes[0].damping_ratio, spectrum.modes[1].damping_ratio, 1e-8);
  EXPECT_NEAR(fit.modes[1].natural_frequency, spectrum.modes[3].natural_frequency, 1e-7);
  EXPECT_NEAR(fit.modes[1].damping_ratio, spectrum.modes[3].damping_ratio, 1e-8);
}

/// Noise hides a mode that hardly moves: its estimated error says so, and those of the others stay
/// small; none is below the actual error.
TEST(IdentifiedModes, SaysHowWellNoisyDataDetermineEachMode) {
  for (std::uint64_t seed = 61; seed < 71; ++seed) {
    Random random(seed);
    System<> system(3);
    system.stiffness.diagonal() << 1600, 400, 100;  // 40, 20, 10 rad/s
    system.damping.diagonal() << 8, 4, 2;
    const Spectrum<> spectrum = analyze(system);
    const Response response(system, spectrum);
    const double noise = 1e-6;
    std::vector<Recording> recordings;
    for (int k = 0; k < 3; ++k) {
      const VectorXd q{{random.uniform(1, 2), random.uniform(1, 2), 1e-5}};
      Recording one = record(response, q, VectorXd::Zero(3), 0.001, 300);
      one.position += noise * random.matrix(3, 300);
      one.velocity += 20 * noise * random.matrix(3, 300);
      recordings.push_back(one);
    }
    const IdentifiedModes fit = identify_modes(recordings, {.period = 0.001, .stride = 25});
    ASSERT_EQ(fit.modes.size() + fit.unpaired.size() / 2, 3u);
    EXPECT_GT(fit.condition, 1e4);
    for (const IdentifiedMode& mode : fit.modes) {
      double nearest = 1e9;
      for (const Mode<>& truth : spectrum.modes) {
        nearest = std::min(nearest, modulus(mode.eigenvalues[0] - truth.eigenvalues[0]));
      }
      EXPECT_LE(nearest, mode.error);
    }
    const auto errors_below = [&](double bound) {
      return std::count_if(fit.modes.begin(), fit.modes.end(),
                           [&](const IdentifiedMode& mode) { return mode.error < bound; });
    };
    EXPECT_EQ(errors_below(1e-2), 2);
    EXPECT_EQ(errors_below(1), 2);
  }
}

TEST(IdentifiedModes, LeavesAloneWhatHasNoPartner) {
  Recording decay{MatrixXd(1, 20), MatrixXd(1, 20)};  // one of two real eigenvalues
  Recording flip = decay;                             // faster than the samples can tell
  for (int k = 0; k < 20; ++k) {
    decay.position(0, k) = std::exp(-3 * 0.1 * k);
    decay.velocity(0, k) = -3 * decay.position(0, k);
    flip.position(0, k) = k % 2 == 0 ? 1 : -1;
    flip.velocity(0, k) = 0;
  }
  const IdentifiedModes one = identify_modes({decay}, {.period = 0.1, .stride = 1});
  EXPECT_EQ(one.rank, 1);
  EXPECT_TRUE(one.modes.empty());
  ASSERT_EQ(one.unpaired.size(), 1u);
  EXPECT_NEAR(modulus(one.unpaired[0] + 3.0), 0, 1e-12);
  const IdentifiedModes two = identify_modes({flip}, {.period = 0.1, .stride = 1});
  ASSERT_EQ(two.unpaired.size(), 1u);
  EXPECT_NEAR(modulus(two.unpaired[0] - Complex(0, std::numbers::pi / 0.1)), 0, 1e-12);
}

TEST(IdentifiedModes, RefusesWhatItCannotFit) {
  const auto refused = [](const std::vector<Recording>& recordings,
                          const IdentificationOptions& options = {}) {
    return testing::refusal<std::invalid_argument>([&] { identify_modes(recordings, options); });
  };
  Random random(80);
  const Recording good{random.matrix(2, 30), random.matrix(2, 30)};
  EXPECT_EQ(refused({good}), "accepted");
  EXPECT_EQ(refused({}), "identify_modes: there is no recording");
  const Recording other{random.matrix(3, 30), random.matrix(3, 30)};
  const std::string sizes =
      "identify_modes: recording 2: positions and velocities have to be of one size, with as many "
      "rows as others";
  EXPECT_EQ(refused({good, other}), sizes);
  EXPECT_EQ(refused({good, {random.matrix(2, 30), random.matrix(2, 29)}}), sizes);
  Recording bad = good;
  bad.velocity(1, 7) = std::nan("");
  EXPECT_EQ(refused({bad}), "identify_modes: recording 1: an entry is not finite");
  EXPECT_EQ(refused({{MatrixXd::Zero(2, 30), MatrixXd::Zero(2, 30)}}),
            "identify_modes: nothing moves");
  EXPECT_EQ(refused({{random.matrix(2, 5), random.matrix(2, 5)}}),
            "identify_modes: 4 pairs of samples are too few, need 5 or more");
  EXPECT_EQ(refused({good}, {.stride = 26}),
            "identify_modes: 4 pairs of samples are too few, need 5 or more");
  EXPECT_EQ(refused({good}, {.period = 0}), "identify_modes: period has to be positive, s");
  EXPECT_EQ(refused({good}, {.stride = -1}), "identify_modes: stride must not be negative");
  EXPECT_EQ(refused({good}, {.rank_tolerance = 0}),
            "identify_modes: rank_tolerance has to be between 0 and 1");
  EXPECT_EQ(refused({good}, {.mass = MatrixXd::Identity(3, 3)}),
            "identify_modes: mass has to be n x n");
  EXPECT_EQ(refused({good}, {.mass = -MatrixXd::Identity(2, 2)}),
            "identify_modes: mass is not positive definite");
}

}  // namespace
}  // namespace dashpot::analysis
