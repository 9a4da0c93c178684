// Shares of modes in a motion, against eigenvectors, undamped modes and sampled motions.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kN = 4;

System<> damped_system(testing::Random& random, double damping) {
  System<> system(kN);
  system.mass = random.spd(kN);
  system.stiffness = 100 * random.spd(kN);
  system.damping = damping * random.spd(kN);
  return system;
}

ModeShares shares_of(const System<>& system, const Cause& cause) {
  return mode_shares(system, analyze(system), cause, MatrixXd::Identity(kN, kN));
}

TEST(ModeShares, AreTheEnergiesOfEachModesOwnMotion) {
  testing::Random random(61);
  int overdamped = 0;
  for (int k = 0; k < 40; ++k) {
    const System<> system = damped_system(random, random.log_uniform(0.1, 100));
    const Spectrum<> spectrum = analyze(system);
    const VectorXd q = random.vector(kN), v = random.vector(kN);
    const ModeShares shares = shares_of(system, {q, v, {}, {}});
    Eigen::MatrixXcd X(2 * kN, 2 * kN);  // columns [u; lambda u]
    for (int i = 0; i < 2 * kN; ++i) {
      const Mode<>& mode = spectrum.modes[i / 2];
      const auto which = static_cast<std::size_t>(i % 2);
      X.col(i) << mode.shapes[which], mode.eigenvalues[which] * mode.shapes[which];
    }
    VectorXd state(2 * kN);
    state << q, v;
    const Eigen::VectorXcd at = X.lu().solve(state.cast<Complex>());
    const auto energy = [&](const VectorXd& z) {
      return 0.5 * (z.head(kN).dot(system.stiffness * z.head(kN)) +
                    z.tail(kN).dot(system.mass * z.tail(kN)));
    };
    VectorXd expected(kN);
    for (int i = 0; i < kN; ++i) {
      expected[i] = energy((X.middleCols(2 * i, 2) * at.segment(2 * i, 2)).real());
      overdamped += spectrum.modes[i].kind == ModeKind::kOverdamped ? 1 : 0;
    }
    EXPECT_TRUE(testing::near(shares.energy, expected / expected.sum(), 1e-9)) << k;
    EXPECT_NEAR(shares.energy.sum(), 1, 1e-12);
    EXPECT_NEAR(shares.cross, energy(state) / expected.sum() - 1, 1e-9);
    EXPECT_EQ(shares.zero_modes, 0);
  }
  EXPECT_GT(overdamped, 20);
}

TEST(ModeShares, HaveNoCrossTermsWhereUndampedModesDecouple) {
  testing::Random random(62);
  System<> system = damped_system(random, 0);
  system.damping = 0.3 * system.mass + 0.002 * system.stiffness;
  const VectorXd q = random.vector(kN), v = random.vector(kN);
  const ModeShares shares = shares_of(system, {q, v, {}, {}});
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> undamped(system.stiffness, system.mass);
  const VectorXd x = undamped.eigenvectors().transpose() * system.mass * q;
  const VectorXd y = undamped.eigenvectors().transpose() * system.mass * v;
  const VectorXd energy = undamped.eigenvalues().cwiseProduct(x.cwiseAbs2()) + y.cwiseAbs2();
  EXPECT_TRUE(testing::near(shares.energy, (energy / energy.sum()).reverse(), 1e-11));
  EXPECT_NEAR(shares.cross, 0, 1e-12);
}

TEST(ModeShares, OfAStepAndAnImpulseAreThoseOfReleases) {
  testing::Random random(63);
  const System<> system = damped_system(random, 2);
  const VectorXd f = random.vector(kN), q = random.vector(kN);
  const auto expect_same = [](const ModeShares& a, const ModeShares& b) {
    EXPECT_TRUE(testing::near(a.energy, b.energy, 1e-11));
    EXPECT_TRUE(testing::near(a.amplitude, b.amplitude, 1e-11));
    EXPECT_NEAR(a.cross, b.cross, 1e-11);
  };
  expect_same(shares_of(system, {q, {}, {}, f}),
              shares_of(system, {q - system.stiffness.lu().solve(f), {}, {}, {}}));
  expect_same(shares_of(system, {q, {}, f, {}}),
              shares_of(system, {q, system.mass.lu().solve(f), {}, {}}));
}

TEST(ModeShares, TellOfTheDriftOfAZeroMode) {
  System<> system(2);
  system.stiffness << 3, -3, -3, 3;
  const ModeShares shares = mode_shares(
      system, analyze(system), {{}, Eigen::Vector2d(1.5, 0.5), {}, {}}, MatrixXd::Identity(2, 2));
  EXPECT_NEAR(shares.zero_modes, 0.8, 1e-12);  // the mean of the velocities is 1, half their
  EXPECT_NEAR(shares.energy[0], 0.2, 1e-12);   // difference 0.5
  EXPECT_NEAR(shares.amplitude(0, 0), 0.5 / std::sqrt(6), 1e-12);
}

TEST(ModeShares, HaveTheLargestDisplacementForAnAmplitude) {
  testing::Random random(64);
  for (const double zeta : {0.0, 0.05, 0.7, 1 - 1e-9, 1.0, 1 + 1e-9, 1.5, 6.0}) {
    for (int k = 0; k < 8; ++k) {
      System<> system(1);
      system.stiffness(0, 0) = 4;
      system.damping(0, 0) = 4 * zeta;
      const VectorXd q = random.vector(1), v = 4 * random.vector(1);
      const Spectrum<> spectrum = analyze(system);
      const ModeShares shares =
          mode_shares(system, spectrum, {q, v, {}, {}}, MatrixXd::Constant(1, 1, -3));
      const Response response(system, spectrum);
      double largest = 0;
      for (int i = 0; i <= 600; ++i) {
        largest = std::max(largest, 3 * std::abs(response.free(q, v, 1e-2 * i).position[0]));
      }
      EXPECT_NEAR(shares.amplitude(0, 0), largest, 3e-4 * (1 + largest)) << zeta;
    }
  }
}

TEST(ModeShares, AreRefusedForPointsAndCausesOfAnotherSize) {
  testing::Random random(65);
  const System<> system = damped_system(random, 1);
  EXPECT_THROW(mode_shares(system, analyze(system), {}, MatrixXd::Identity(3, 3)),
               std::invalid_argument);
  EXPECT_THROW(shares_of(system, {random.vector(3), {}, {}, {}}), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::analysis
