// Shares of modes in a motion, against eigenvectors, undamped modes and sampled motions.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/spectrum/modal_basis.hpp>
#include <dashpot/tests/support/made_to_measure.hpp>
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
using testing::near;

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

// Coordinates and drive of a modal basis, from bases that are exact by construction and from the
// solver's.

/// [U; U Lambda]
MatrixXd states_of(const ModalBasis<>& basis) {
  MatrixXd Z(2 * basis.U.rows(), basis.U.cols());
  Z << basis.U, basis.U * basis.Lambda;
  return Z;
}

/// Draws coordinates, and expects them from their state.
void expect_coordinates(testing::Random& random, const System<>& system,
                        const Spectrum<>& spectrum) {
  const VectorXd xi = random.vector(8);
  const VectorXd state = states_of(spectrum.basis) * xi;
  const VectorXd found = coordinates<kDynamic>(spectrum.basis, system.mass, system.damping,
                                               state.head(4), state.tail(4));
  EXPECT_TRUE(near(found, xi, 1e-11));
}

TEST(Coordinates, AreThoseOfTheStateInTheBasis) {
  testing::Random random(51);
  for (const auto& make : {&testing::make_system_of_every_kind, &testing::make_defective_system}) {
    const auto [system, spectrum] = make(random);
    expect_coordinates(random, system, spectrum);
  }
}

TEST(Coordinates, AreRefinedWhereTheLeftBasisIsInexact) {
  testing::Random random(52);
  auto [system, spectrum] = testing::make_system_of_every_kind(random);
  spectrum.basis.weight *= 1 + 1e-7;
  expect_coordinates(random, system, spectrum);
}

TEST(Drive, IsTheChangeOfCoordinatesByAnImpulse) {
  testing::Random random(53);
  const auto [system, spectrum] = testing::make_system_of_every_kind(random);
  const VectorXd f = random.vector(4);
  const VectorXd jump = coordinates<kDynamic>(spectrum.basis, system.mass, system.damping,
                                              VectorXd::Zero(4), system.mass.lu().solve(f));
  EXPECT_TRUE(near(drive<kDynamic>(spectrum.basis, f), jump, 1e-11));
}

/// A system with r zero modes, which the damping couples with each other and with all others.
System<> coupled_system(testing::Random& random, Eigen::Index n, Eigen::Index r) {
  System<> system(n);
  const MatrixXd W = 5 * random.matrix(n - r, n);
  system.mass = random.spd(n);
  system.damping = random.spd(n);
  system.stiffness = W.transpose() * W;
  system.stiffness = (0.5 * (system.stiffness + system.stiffness.transpose())).eval();
  system.stiffness_factor = W;
  return system;
}

TEST(ModalBasis, OfTheSolverIsDualToItsLeftBasis) {
  testing::Random random(55);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Index n = random.integer(1, 8);
    const Eigen::Index r = random.integer(0, static_cast<int>(std::min<Eigen::Index>(3, n)));
    const System<> system = coupled_system(random, n, r);
    const ModalBasis<> basis = analyze(system).basis;
    MatrixXd left(2 * n, 2 * n);
    left << basis.Y, basis.Y * basis.Gamma;
    MatrixXd B(2 * n, 2 * n);
    B << system.damping, system.mass, system.mass, MatrixXd::Zero(n, n);
    const MatrixXd product = basis.weight * left.transpose() * B * states_of(basis);
    EXPECT_TRUE(near(product, MatrixXd::Identity(2 * n, 2 * n), 1e-10)) << n << " " << r;
  }
}

}  // namespace
}  // namespace dashpot::analysis
