// Families with modes in closed form, at any size, and what kind of mode is said to be what.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::near;
using testing::Random;
using testing::symmetrized;
using testing::system_from;

struct ClosedForm {
  double omega, zeta;
};

/// lambda^2 + d lambda + kappa
ClosedForm of_coefficients(double d, double kappa) {
  return {std::sqrt(kappa), d / (2 * std::sqrt(kappa))};
}

/// Each computed mode is one of the expected ones, to a relative tolerance; each is taken once.
void expect_modes(const Spectrum<>& spectrum, std::vector<ClosedForm> expected, double tolerance) {
  ASSERT_EQ(spectrum.status, Status::kOk);
  ASSERT_EQ(spectrum.modes.size(), static_cast<int>(expected.size()));
  for (const Mode<>& mode : spectrum.modes) {
    const auto away = [&](const ClosedForm& truth) {
      return std::max(std::abs(mode.natural_frequency - truth.omega) / truth.omega,
                      std::abs(mode.damping_ratio - truth.zeta) / std::max(truth.zeta, 1.0));
    };
    const auto nearest =
        std::min_element(expected.begin(), expected.end(),
                         [&](const auto& a, const auto& b) { return away(a) < away(b); });
    EXPECT_LE(away(*nearest), tolerance) << nearest->omega << " rad/s, zeta " << nearest->zeta;
    EXPECT_LE(mode.backward_error, 1e-13);
    expected.erase(nearest);
  }
}

/// A random mass, K and C with modes of these frequencies, all of them with damping ratio zeta.
System<> classical(Random& random, const VectorXd& omega, double zeta) {
  const Eigen::Index n = omega.size();
  const MatrixXd M = random.spd(n);
  const MatrixXd L = M.llt().matrixL();
  const MatrixXd P = L * MatrixXd(random.matrix(n, n).householderQr().householderQ());
  return system_from(M, symmetrized(P * VectorXd(2 * zeta * omega).asDiagonal() * P.transpose()),
                     symmetrized(P * omega.cwiseAbs2().asDiagonal() * P.transpose()));
}

class ClassicalDamping : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Ratios, ClassicalDamping,
                         ::testing::Values(0, 1e-12, 1e-6, 0.7, 1 - 1e-2, 1 - 1e-5, 1 - 1e-8,
                                           1 - 1e-12, 1, 1 + 1e-12, 1 + 1e-8, 1 + 1e-5, 1 + 1e-2,
                                           30, 1e3));

TEST_P(ClassicalDamping, IsFoundInEveryMode) {
  const double zeta = GetParam();
  Random random(501);
  for (const int n : {1, 3, 7, 14}) {
    SCOPED_TRACE(n);
    const VectorXd omega = VectorXd::LinSpaced(n, 2, 30);
    const Spectrum<> spectrum = analyze(classical(random, omega, zeta));
    std::vector<ClosedForm> expected;
    for (const double w : omega) expected.push_back({w, zeta});
    expect_modes(spectrum, expected, 1e-12);
    for (const Mode<>& mode : spectrum.modes) {
      if (zeta < 1e-3) {
        EXPECT_NEAR(mode.damping_ratio, zeta, 1e-15);
      }
      if (zeta == 0) {
        EXPECT_EQ(mode.kind, ModeKind::kUndamped);
      } else if (zeta < 1 - 1e-10) {
        EXPECT_EQ(mode.kind, ModeKind::kUnderdamped)
            << "zeta " << mode.damping_ratio << ", bound " << mode.damping_ratio_bound;
      } else if (zeta > 1 + 1e-10) {
        EXPECT_EQ(mode.kind, ModeKind::kOverdamped);
      }
    }
  }
}

/// NLEVP "sleeper": A is circulant [1 -2 1], C = I + A^2, K = I + A + A^2, all of them integers. If
/// n is a multiple of six, -1 has two Jordan blocks, which rounding errors split.
TEST(SleeperFamily, HasTwoCriticalModes) {
  for (const int n : {6, 12, 24}) {
    const MatrixXd I = MatrixXd::Identity(n, n);
    MatrixXd A = -2 * I;
    for (int i = 0; i < n; ++i) A(i, (i + 1) % n) = A((i + 1) % n, i) = 1;
    int critical = 0;
    for (const Mode<>& mode : analyze(system_from(I, I + A * A, I + A + A * A)).modes) {
      if (mode.kind != ModeKind::kCritical) continue;
      ++critical;
      EXPECT_NEAR(mode.natural_frequency, 1, 1e-13);
      EXPECT_NEAR(mode.damping_ratio, 1, 1e-13);
      EXPECT_LE(std::abs(mode.eigenvalues[0] + 1.0), mode.error_bound);
    }
    EXPECT_EQ(critical, 2) << n;
  }
}

TEST(CriticalOscillator, IsExact) {
  const Spectrum<> spectrum = analyze(testing::one_joint(1, 2, 1));
  ASSERT_EQ(spectrum.modes.size(), 1);
  const Mode<>& mode = spectrum.modes[0];
  EXPECT_EQ(mode.kind, ModeKind::kCritical);
  EXPECT_NEAR(mode.damping_ratio, 1, 1e-15);
  EXPECT_NEAR(mode.natural_frequency, 1, 1e-15);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_LE(std::abs(mode.eigenvalues[k] + 1.0), 1e-7);
    EXPECT_NEAR(std::abs(mode.shapes[k][0]), 1, 1e-15);
    EXPECT_NEAR(std::abs(mode.left_shapes[k][0]), 1, 1e-15);
  }
  EXPECT_LE(mode.damping_ratio_bound, 1e-13);
}

TEST(ProportionalDamping, ComesWithAModalMatrix) {
  Random random(502);
  for (int trial = 0; trial < 30; ++trial) {
    const int n = random.integer(1, 12);
    const double a = trial % 3 == 0 ? 0 : random.log_uniform(1e-3, 10);
    const double b = trial % 3 == 0 ? 0 : random.log_uniform(1e-4, 1);
    const MatrixXd M = random.spd(n), K = 100 * random.spd(n);
    const System<> system = system_from(M, a * M + b * K, K);
    const Spectrum<> spectrum = analyze(system);
    EXPECT_TRUE(spectrum.proportional);
    const MatrixXd& Phi = spectrum.zero_modes.coordinates;
    const VectorXd& kappa = spectrum.zero_modes.stiffness_values;
    const double size = kappa[0];
    EXPECT_TRUE(near(Phi.transpose() * M * Phi, MatrixXd::Identity(n, n), 1e-13));
    EXPECT_TRUE(near(Phi.transpose() * K * Phi, MatrixXd(kappa.asDiagonal()), 1e-13 * size));
    std::vector<ClosedForm> expected;
    for (const double k : kappa) expected.push_back(of_coefficients(a + b * k, k));
    expect_modes(spectrum, expected, 1e-11);
    for (const Mode<>& mode : spectrum.modes) {
      if (a > 0) continue;
      EXPECT_EQ(mode.kind, ModeKind::kUndamped);
      EXPECT_EQ(mode.damping_ratio, 0);
    }
  }
}

TEST(ProportionalDamping, IsNotSeenWhereDampingMixesTheModes) {
  Random random(503);
  EXPECT_FALSE(analyze(system_from(random.spd(4), random.spd(4), random.spd(4))).proportional);
}

TEST(NegativeDamping, IsUnstable) {
  const Spectrum<> one = analyze(testing::one_joint(1, -0.2, 4));
  EXPECT_EQ(one.modes[0].kind, ModeKind::kUnstable);
  EXPECT_NEAR(one.modes[0].damping_ratio, -0.05, 1e-16);
  EXPECT_NEAR(one.modes[0].eigenvalues[0].real(), 0.1, 1e-16);

  Random random(504);
  MatrixXd C = random.spd(4);
  C(2, 2) = -3;
  const Spectrum<> several = analyze(system_from(random.spd(4), C, 30 * random.spd(4)));
  ASSERT_EQ(several.status, Status::kOk);
  int unstable = 0;
  for (const Mode<>& mode : several.modes) {
    const bool grows = mode.eigenvalues[0].real() > 0 || mode.eigenvalues[1].real() > 0;
    EXPECT_EQ(mode.kind == ModeKind::kUnstable, grows);
    unstable += grows ? 1 : 0;
  }
  EXPECT_GE(unstable, 1);
}

TEST(IndefiniteStiffness, IsUnstableWithoutAFrequency) {
  System<> system = system_from(MatrixXd::Identity(2, 2), 0.3 * MatrixXd::Identity(2, 2),
                                Eigen::Vector2d(4, -9).asDiagonal());
  const Spectrum<> spectrum = analyze(system);
  ASSERT_EQ(spectrum.modes.size(), 2);
  EXPECT_EQ(spectrum.zero_modes.count, 0);
  const auto falling = std::find_if(spectrum.modes.begin(), spectrum.modes.end(),
                                    [](const auto& m) { return m.kind == ModeKind::kUnstable; });
  ASSERT_NE(falling, spectrum.modes.end());
  EXPECT_TRUE(std::isnan(falling->natural_frequency));
  EXPECT_TRUE(std::isnan(falling->damping_ratio));
  const double root = std::sqrt(0.15 * 0.15 + 9);
  EXPECT_NEAR(falling->eigenvalues[0].real(), -0.15 + root, 1e-14);  // nearer zero first
  EXPECT_NEAR(falling->eigenvalues[1].real(), -0.15 - root, 1e-14);
  const Mode<>& other = falling == spectrum.modes.begin() ? spectrum.modes[1] : spectrum.modes[0];
  EXPECT_EQ(other.kind, ModeKind::kUnderdamped);
  EXPECT_NEAR(other.natural_frequency, 2, 1e-14);
}

TEST(SoftModes, AreThoseBelowTheFrequencyGiven) {
  const System<> system = system_from(MatrixXd::Identity(2, 2), 0.01 * MatrixXd::Identity(2, 2),
                                      Eigen::Vector2d(1e-8, 4).asDiagonal());
  SpectrumOptions options;
  options.soft_frequency = 1e-3;
  const Spectrum<> spectrum = analyze(system, options);
  ASSERT_EQ(spectrum.modes.size(), 2);
  EXPECT_EQ(spectrum.modes[0].kind, ModeKind::kUnderdamped);
  EXPECT_EQ(spectrum.modes[1].kind, ModeKind::kSoft);
  EXPECT_NEAR(spectrum.modes[1].natural_frequency, 1e-4, 1e-17);
  EXPECT_EQ(analyze(system).modes[1].kind, ModeKind::kOverdamped);
}

TEST(ModeKinds, HaveNames) {
  EXPECT_STREQ(to_text(ModeKind::kUnderdamped), "underdamped");
  EXPECT_STREQ(to_text(ModeKind::kCritical), "critical");
  EXPECT_STREQ(to_text(ModeKind::kOverdamped), "overdamped");
  EXPECT_STREQ(to_text(ModeKind::kUndamped), "undamped");
  EXPECT_STREQ(to_text(ModeKind::kUnstable), "unstable");
  EXPECT_STREQ(to_text(ModeKind::kSoft), "soft");
}

}  // namespace
}  // namespace dashpot::analysis
