// Systems that once got a dangerous answer: a growing motion reported as a harmless one, numbers
// with the status kOk that mean nothing.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;

Spectrum<> solve(const MatrixXd& mass, const MatrixXd& damping, const MatrixXd& stiffness) {
  Spectrum<> spectrum;
  SpectrumSolver<>().solve(testing::system_from(mass, damping, stiffness), spectrum);
  return spectrum;
}

// Eigenvalues 0.33 +- 0.56 i, of a defective system for which no bound is found.
TEST(EnclosureAttack, GrowingModesWithoutBoundsAreUnstable) {
  for (int seed = 0; seed < 200; ++seed) {
    // A chain of equal modes, each driven by the next: a Jordan block of size 2n.
    const int n = 3 + seed % 3;
    MatrixXd stiffness = MatrixXd::Identity(n, n);
    MatrixXd damping = -0.01 * (1 + seed) * MatrixXd::Identity(n, n);
    for (int i = 0; i + 1 < n; ++i) stiffness(i, i + 1) = 1;
    const Spectrum<> spectrum = solve(MatrixXd::Identity(n, n), damping, stiffness);
    for (const Mode<>& mode : spectrum.modes) {
      if (std::isfinite(mode.error_bound)) continue;
      EXPECT_EQ(mode.kind, ModeKind::kUnstable) << mode.eigenvalues[0] << ", seed " << seed;
    }
  }
}

// A pair (-945, 2.7e-11 +- 1.2e-9) has no frequency; it was called overdamped.
TEST(EnclosureAttack, ModesWithoutAFrequencyAreSoft) {
  int seen = 0;
  for (int i = 0; i < 200; ++i) {
    MatrixXd mass(2, 2), damping(2, 2), stiffness(2, 2);
    mass << 1, 0.3, 0.3, 2;
    damping << 1000 + i, 7, 3, 900;
    stiffness << 1, 1, 1, 1 + (i % 2 == 0 ? -1 : 1) * 1e-15 * i;
    const Spectrum<> spectrum = solve(mass, damping, stiffness);
    for (const Mode<>& mode : spectrum.modes) {
      if (!std::isnan(mode.natural_frequency)) continue;
      ++seen;
      EXPECT_TRUE(mode.kind == ModeKind::kSoft || mode.kind == ModeKind::kUnstable) << i;
    }
  }
  RecordProperty("modes_without_a_frequency", seen);
}

// q'' = [0.1 -1; 1 0.1] q' grows as exp(0.1 t): it was reported as two zero modes at rest.
TEST(EnclosureAttack, ComplexPairsOfZeroModesAreListed) {
  MatrixXd damping(2, 2);
  damping << -0.1, 1, -1, -0.1;
  const Spectrum<> spectrum = solve(MatrixXd::Identity(2, 2), damping, MatrixXd::Zero(2, 2));
  EXPECT_EQ(spectrum.status, Status::kOk);
  EXPECT_EQ(spectrum.zero_modes.count, 2);
  ASSERT_EQ(spectrum.modes.size(), 1);
  EXPECT_EQ(spectrum.modes[0].kind, ModeKind::kUnstable);
  EXPECT_LE(std::abs(spectrum.modes[0].eigenvalues[0] - Complex(0.1, 1)),
            spectrum.modes[0].error_bound);
  for (const double rate : spectrum.zero_mode_rates) EXPECT_TRUE(std::isnan(rate));
}

// Beside a fast pair of zero modes, a slow growing mode was left out.
TEST(EnclosureAttack, ComplexPairsOfZeroModesHideNoMode) {
  MatrixXd damping = MatrixXd::Zero(3, 3), stiffness = MatrixXd::Zero(3, 3);
  damping(0, 1) = 100;
  damping(1, 0) = -100;
  damping(2, 2) = -0.2;
  stiffness(2, 2) = 4;
  const Spectrum<> spectrum = solve(MatrixXd::Identity(3, 3), damping, stiffness);
  EXPECT_EQ(spectrum.status, Status::kOk);
  ASSERT_EQ(spectrum.modes.size(), 2);
  EXPECT_NEAR(spectrum.modes[0].natural_frequency, 100, 1e-10);
  EXPECT_EQ(spectrum.modes[1].kind, ModeKind::kUnstable);
  EXPECT_NEAR(spectrum.modes[1].damping_ratio, -0.05, 1e-12);
}

// M^-1 K overflows; a matrix that is not symmetric got two zero modes and the status kOk.
TEST(EnclosureAttack, OverflowIsNotASystemOfZeroModes) {
  for (const double other : {2e299, 3e299}) {
    MatrixXd stiffness(2, 2);
    stiffness << 1e300, 2e299, other, 1e300;
    const MatrixXd mass = 1e-300 * MatrixXd::Identity(2, 2);
    const Spectrum<> spectrum = solve(mass, MatrixXd::Zero(2, 2), stiffness);
    EXPECT_EQ(spectrum.status, Status::kOverflow) << to_text(spectrum.status);
    EXPECT_TRUE(spectrum.modes.empty());
  }
}

// Residuals of such numbers underflow to zero: errors of half an eigenvalue had bounds of 1e-13.
TEST(EnclosureAttack, UnderflowIsNotAProof) {
  MatrixXd mass(3, 3), stiffness(3, 3);
  mass << 2, 0.5, 0.1, 0.5, 1, 0.3, 0.1, 0.3, 3;
  stiffness << 5, 1, 2, 1, 4, -1, 2, -1, 6;
  for (const double scale : {1e-10, 1e-40, 1e-70, 1e-100, 1e-130, 1e-145, 1e70, 1e100}) {
    const Spectrum<> spectrum = solve(mass / scale, MatrixXd::Zero(3, 3), stiffness * scale);
    const bool within = scale > 1e-60 && scale < 1e60;
    EXPECT_EQ(spectrum.status == Status::kOk, within) << scale << ": " << to_text(spectrum.status);
    for (const Mode<>& mode : spectrum.modes) {
      EXPECT_EQ(std::isfinite(mode.error_bound), within) << scale;
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
