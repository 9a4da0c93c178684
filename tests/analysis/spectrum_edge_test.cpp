// Systems at the edges: empty ones, bad ones, ones that are not symmetric, coupled zero modes.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using testing::distance_to_nearest;
using testing::kInfinity;
using testing::kNan;
using testing::LongComplex;
using testing::near;
using testing::Random;
using testing::symmetrized;
using testing::system_from;
using testing::true_eigenvalues;
using testing::worst_distance;

/// All 2n: of the modes, then of the zero modes.
std::vector<Complex> all_eigenvalues(const Spectrum<>& spectrum) {
  std::vector<Complex> all;
  for (const Mode<>& mode : spectrum.modes) {
    all.insert(all.end(), mode.eigenvalues.begin(), mode.eigenvalues.end());
  }
  all.resize(all.size() + static_cast<std::size_t>(spectrum.zero_modes.count), 0.0);
  for (const double rate : spectrum.zero_mode_rates) all.emplace_back(rate);
  return all;
}

/// Every eigenvalue within the bound of its mode, and both eigenvectors solve their equations.
void expect_proper_modes(const System<>& system, const Spectrum<>& spectrum) {
  const std::vector<LongComplex> truth = true_eigenvalues(system);
  for (const Mode<>& mode : spectrum.modes) {
    for (std::size_t k = 0; k < 2; ++k) {
      const Complex lambda = mode.eigenvalues[k];
      EXPECT_LE(distance_to_nearest(lambda, truth), mode.error_bound) << lambda;
      EXPECT_LE(mode.error_bound, 1e-9 * std::abs(lambda)) << lambda;
      const MatrixXcd Q =
          lambda * lambda * system.mass + lambda * system.damping + system.stiffness;
      const double size = std::norm(lambda) * system.mass.norm() +
                          std::abs(lambda) * system.damping.norm() + system.stiffness.norm();
      const auto& u = mode.shapes[k];
      const auto& y = mode.left_shapes[k];
      EXPECT_LE((Q * u).norm(), 1e-13 * size * u.norm()) << lambda;
      EXPECT_LE((y.transpose() * Q).norm(), 1e-13 * size * y.norm()) << lambda;
      EXPECT_NEAR((u.adjoint() * system.mass * u).value().real(), 1, 1e-13);
    }
  }
}

Status status_of(const System<>& system) {
  Spectrum<> spectrum;
  const Status status = SpectrumSolver<>().solve(system, spectrum);
  EXPECT_EQ(status, spectrum.status);
  EXPECT_TRUE(spectrum.modes.empty() || status == Status::kOk);
  return status;
}

TEST(SpectrumOfNothing, HasNoModes) {
  const Spectrum<> spectrum = analyze(System<>(0));
  EXPECT_EQ(spectrum.status, Status::kOk);
  EXPECT_TRUE(spectrum.modes.empty());
  EXPECT_EQ(spectrum.zero_modes.count, 0);
  EXPECT_EQ(spectrum.zero_mode_rates.size(), 0);
}

TEST(SpectrumOfOneCoordinate, IsTheTextbookOscillator) {
  System<> system(1);
  system.mass << 2;
  system.damping << 4;
  system.stiffness << 50;
  const Spectrum<> spectrum = analyze(system);
  ASSERT_EQ(spectrum.modes.size(), 1);
  const Mode<>& mode = spectrum.modes[0];
  EXPECT_NEAR(mode.natural_frequency, 5, 1e-15);
  EXPECT_NEAR(mode.damping_ratio, 0.2, 1e-16);
  EXPECT_NEAR(mode.damped_frequency, std::sqrt(24.0), 1e-15);
  EXPECT_NEAR(std::abs(mode.shapes[0][0]), std::sqrt(0.5), 1e-15);
  EXPECT_TRUE(spectrum.proportional);
}

/// Without damping a mode is certainly undamped and needs no more digits; the solver decides this
/// for each system again.
TEST(SpectrumOfOneCoordinate, NeedsNoMoreDigitsWithoutDamping) {
  SpectrumSolver<> solver;
  Spectrum<> spectrum;
  System<> system(1);
  system.mass << 2;
  system.stiffness << 50;
  for (const double damping : {0.0, 1e-16, 0.0, 4.0}) {
    system.damping << damping;
    ASSERT_EQ(solver.solve(system, spectrum), Status::kOk);
    EXPECT_EQ(spectrum.extended, damping == 1e-16) << damping;
  }
}

TEST(SpectrumWithoutStiffness, HasOnlyZeroModes) {
  Random random(301);
  const MatrixXd M = random.spd(4), Z = MatrixXd::Zero(4, 4);
  const Spectrum<> still = analyze(system_from(M, Z, Z));
  EXPECT_EQ(still.zero_modes.count, 4);
  EXPECT_TRUE(still.modes.empty());
  EXPECT_TRUE(near(still.zero_mode_rates, MatrixXd::Zero(4, 1), 0));

  const System<> damped = system_from(M, random.spd(4), Z);
  const Spectrum<> spectrum = analyze(damped);
  EXPECT_EQ(spectrum.zero_modes.count, 4);
  EXPECT_TRUE(spectrum.modes.empty());
  EXPECT_LE(worst_distance(all_eigenvalues(spectrum), true_eigenvalues(damped)), 1e-13);
  EXPECT_LT(spectrum.zero_mode_rates.maxCoeff(), 0);
}

TEST(SpectrumOfBadInput, HasAStatusAndNoModes) {
  Random random(302);
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (const auto part : {&System<>::mass, &System<>::damping, &System<>::stiffness}) {
      System<> system = system_from(random.spd(3), random.spd(3), random.spd(3));
      (system.*part)(1, 1) = bad;
      EXPECT_EQ(status_of(system), Status::kNotFinite) << bad;
      EXPECT_THROW(analyze(system), InvalidSystem);
    }
  }
  System<> system = system_from(random.spd(3), random.spd(3), random.spd(3));
  system.mass(0, 1) += 0.1;
  EXPECT_EQ(status_of(system), Status::kNotSymmetric);
  system.mass = Eigen::Vector3d(1, 0, 1).asDiagonal();
  EXPECT_EQ(status_of(system), Status::kMassNotPositiveDefinite);
  system.mass = Eigen::Vector3d(1, 2, -1).asDiagonal();
  EXPECT_EQ(status_of(system), Status::kMassNotPositiveDefinite);
  EXPECT_THROW(analyze(system), InvalidSystem);
}

TEST(SpectrumSolver, RecoversAfterBadInput) {
  Random random(303);
  const System<> good = system_from(random.spd(4), random.spd(4), random.spd(4));
  System<> bad = good;
  bad.mass.setZero();
  SpectrumSolver<> solver;
  Spectrum<> spectrum;
  EXPECT_EQ(solver.solve(bad, spectrum), Status::kMassNotPositiveDefinite);
  EXPECT_EQ(solver.solve(good, spectrum), Status::kOk);
  EXPECT_EQ(spectrum.modes.size(), 4);
  expect_proper_modes(good, spectrum);
}

TEST(SpectrumOfNonsymmetricSystems, AgreesWithTheStateMatrix) {
  Random random(304);
  for (int trial = 0; trial < 60; ++trial) {
    const bool with_zero_modes = trial % 4 == 3;
    const int n = with_zero_modes ? 5 : random.integer(2, 8), rank = with_zero_modes ? 3 : n;
    const MatrixXd half = random.matrix(rank, rank), skew = half - half.transpose();
    const MatrixXd J = with_zero_modes ? random.matrix(3, 5) : MatrixXd::Identity(n, n);
    const double gyroscopic = trial % 4 == 0 || with_zero_modes ? 0 : random.log_uniform(1e-6, 1);
    const double circulatory = with_zero_modes  ? 1
                               : trial % 4 == 1 ? 0
                                                : random.log_uniform(1e-6, 1);
    const System<> system =
        system_from(random.spd(n), random.spd(n) + gyroscopic * J.transpose() * skew * J,
                    J.transpose() * MatrixXd(50 * random.spd(rank) + circulatory * skew) * J);
    const Spectrum<> spectrum = analyze(system);
    ASSERT_EQ(spectrum.status, Status::kOk);
    EXPECT_FALSE(spectrum.symmetric);
    EXPECT_FALSE(spectrum.proportional);
    ASSERT_EQ(spectrum.zero_modes.count, n - rank);
    ASSERT_EQ(spectrum.modes.size(), rank);
    const std::vector<Complex> computed = all_eigenvalues(spectrum);
    EXPECT_LE(worst_distance(computed, true_eigenvalues(system)), 1e-10 * std::abs(computed[0]));
    expect_proper_modes(system, spectrum);
  }
}

/// n = 5, two zero modes, task damping and joint friction.
System<> redundant_with_friction(Random& random, double friction) {
  const MatrixXd J = random.matrix(3, 5);
  const MatrixXd joint = random.vector(5).cwiseAbs().asDiagonal();
  return system_from(random.spd(5),
                     symmetrized(J.transpose() * random.spd(3) * J + friction * joint),
                     symmetrized(J.transpose() * (40 * random.spd(3)) * J));
}

TEST(CoupledZeroModes, AreSolvedExactly) {
  Random random(306);
  double uncoupled_error = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const System<> system = redundant_with_friction(random, random.log_uniform(1e-3, 30));
    const Spectrum<> spectrum = analyze(system);
    ASSERT_EQ(spectrum.status, Status::kOk);
    ASSERT_EQ(spectrum.zero_modes.count, 2);
    EXPECT_TRUE(spectrum.coupled);
    EXPECT_FALSE(spectrum.proportional);
    const std::vector<Complex> computed = all_eigenvalues(spectrum);
    const std::vector<LongComplex> truth = true_eigenvalues(system);
    EXPECT_LE(worst_distance(computed, truth), 1e-10 * std::abs(computed[0]));
    expect_proper_modes(system, spectrum);

    // Without the coupling: nonzero and zero modes each by themselves.
    const MatrixXd T = spectrum.zero_modes.coordinates;
    MatrixXd D = T.transpose() * system.damping * T;
    const MatrixXd cross = D.topRightCorner(3, 2);
    EXPECT_NEAR(spectrum.coupling, cross.norm() / D.norm(), 1e-12);
    D.topRightCorner(3, 2).setZero();
    D.bottomLeftCorner(2, 3).setZero();
    const MatrixXd K = spectrum.zero_modes.stiffness_values.asDiagonal();
    const Spectrum<> uncoupled = analyze(system_from(MatrixXd::Identity(5, 5), symmetrized(D), K));
    EXPECT_FALSE(uncoupled.coupled);
    uncoupled_error = std::max(
        uncoupled_error, worst_distance(all_eigenvalues(uncoupled), truth) / std::abs(computed[0]));
  }
  EXPECT_GT(uncoupled_error, 0.05);
}

TEST(CoupledZeroModes, AreNotReportedForTaskDamping) {
  Random random(307);
  const Spectrum<> spectrum = analyze(redundant_with_friction(random, 0));
  EXPECT_FALSE(spectrum.coupled);
  EXPECT_LE(spectrum.coupling, 1e-14);
  EXPECT_TRUE(near(spectrum.zero_mode_rates, MatrixXd::Zero(2, 1), 0));
}

/// However strong the damping is: frequency and ratio are proved to as many digits, and with them
/// both eigenvalues are.
TEST(Spectrum, IsFoundBesideANearlyFreeJoint) {
  // The inverse of so soft a spring leaves of the fast eigenvalues nothing, not even a number.
  Eigen::Matrix<double, 6, 6> D;
  D << 2.6673783631222578, 0.0039247755515330329, -0.0044359965291536074, -0.24768789092352697,
      0.048614760619447389, -0.31541513231595331, 0, 12.692802831410525, -0.00054048298535055994,
      0.0004553318312092991, 0.00097876106980247964, 0.00010648116408881747, 0, 0,
      10.047796806641871, -0.0010673727184365434, -0.00088828274859576069, -0.00015092293995718625,
      0, 0, 0, 0.92714257306110837, 0.063716308227788829, 0.095819573390221402, 0, 0, 0, 0,
      0.053884194955044838, 0.017761043704931895, 0, 0, 0, 0, 0, 0.31138720849978174;
  const MatrixXd damping = D.selfadjointView<Eigen::Upper>();
  const Eigen::Vector<double, 6> K(769.15798484662241, 82.192712016661119, 51.501457059400394,
                                   24.103526691503799, 0.044845060339901016, 3.055132673633263e-27);
  const auto system = system_from(MatrixXd::Identity(6, 6), damping, K.asDiagonal());
  Spectrum<> spectrum;
  ASSERT_EQ(SpectrumSolver<>().solve(system, spectrum), Status::kOk);
  EXPECT_EQ(spectrum.zero_modes.count, 0);
  std::vector<LongComplex> truth = true_eigenvalues(system);
  *testing::nearest_to(0, truth) =
      static_cast<long double>(-K[5] / D(5, 5));  // too slow for the truth's digits
  for (const Mode<>& mode : spectrum.modes) {
    for (std::size_t k = 0; k < 2; ++k) {
      const Complex value = mode.eigenvalues[k];
      EXPECT_LE(distance_to_nearest(value, truth), mode.eigenvalue_bounds[k]) << value;
      EXPECT_LE(mode.eigenvalue_bounds[k], 1e-12 * D.norm()) << value;
    }
  }
}

TEST(Spectrum, BoundsEachEigenvalueOfOverdampedModes) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  Random random(4701);
  for (int trial = 0; trial < 120; ++trial) {
    const int n = random.integer(1, trial % 10 == 0 ? 14 : 6);
    System<> system(n);
    system.mass = random.spd(n);
    system.damping = random.log_uniform(1e3, 1e12) * random.spd(n);
    system.stiffness = random.log_uniform(1e-6, 1e3) * random.spd(n);
    const Spectrum<> spectrum = analyze(system);
    EXPECT_EQ(spectrum.status, Status::kOk);
    ASSERT_EQ(spectrum.modes.size(), n);
    const std::vector<LongComplex> truth = testing::proved_eigenvalues(system);
    for (const Mode<>& mode : spectrum.modes) {
      ASSERT_EQ(mode.kind, ModeKind::kOverdamped);
      EXPECT_EQ(mode.error_bound, std::max(mode.eigenvalue_bounds[0], mode.eigenvalue_bounds[1]));
      for (std::size_t k = 0; k < 2; ++k) {
        const Complex value = mode.eigenvalues[k];
        EXPECT_LE(mode.eigenvalue_bounds[k], 1e-9 * modulus(value)) << value;
        EXPECT_LE(distance_to_nearest(value, truth), mode.eigenvalue_bounds[k]) << value;
      }
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
