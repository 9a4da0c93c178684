// Bounds proved from a residual enclose the truth, however bad the basis.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/modes.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::kInfinity;
using testing::LongComplex;
using testing::Random;
using testing::true_eigenvalues;

System<> random_system(Random& random, int n) {
  System<> system(n);
  system.mass = random.spd(n);
  system.damping = random.log_uniform(1e-2, 10) * random.spd(n);
  system.stiffness = 40 * random.spd(n);
  return system;
}

/// The modes of the spectrum's basis as it stands, with proved bounds.
void certify_as_is(const System<>& system, bool extended, Spectrum<>& spectrum,
                   BlockEnclosure<>& enclosure) {
  BasisResidual<> residual;
  evaluate_residual<kDynamic>(system, spectrum.symmetric, extended, spectrum.basis, residual);
  enclose<kDynamic>(residual, spectrum.basis, enclosure);
  read_modes<kDynamic>(system, residual, enclosure, 0, spectrum);
}

struct Enclosed {
  double widest = 0;    ///< largest error bound
  double tightest = 0;  ///< largest error / bound, of eigenvalues, and of damping ratios
  double tightest_ratio = 0;
};

/// Expects every eigenvalue, and the frequency and ratio of clearly complex pairs, within its
/// bound.
Enclosed expect_enclosed(const System<>& system, const Spectrum<>& spectrum) {
  Enclosed seen;
  const std::vector<LongComplex> truth = true_eigenvalues(system);
  for (const Mode<>& mode : spectrum.modes) {
    LongComplex nearest;
    long double error = std::numeric_limits<long double>::infinity();
    for (const LongComplex& z : truth) {
      const long double away = std::abs(z - LongComplex(mode.eigenvalues[0]));
      if (away < error) error = away, nearest = z;
    }
    EXPECT_TRUE(error <= static_cast<long double>(mode.error_bound) ||
                mode.error_bound == kInfinity)
        << "error " << error << ", bound " << mode.error_bound << " at " << mode.eigenvalues[0];
    seen.widest = std::max(seen.widest, mode.error_bound);
    if (!(mode.damped_frequency > 2 * mode.error_bound)) continue;
    const long double omega = std::abs(nearest), zeta = -nearest.real() / omega;
    const long double omega_error =
        std::abs(static_cast<long double>(mode.natural_frequency) - omega);
    const long double zeta_error = std::abs(static_cast<long double>(mode.damping_ratio) - zeta);
    EXPECT_LE(omega_error, mode.natural_frequency_bound);
    EXPECT_LE(zeta_error, mode.damping_ratio_bound);
    seen.tightest = std::max(seen.tightest, static_cast<double>(error) / mode.error_bound);
    seen.tightest_ratio =
        std::max(seen.tightest_ratio, static_cast<double>(zeta_error) / mode.damping_ratio_bound);
  }
  return seen;
}

TEST(RootBounds, AreTheFarthestPointsOfUnionsOfDiscs) {
  // Discs of one group: three that hang together, a fourth apart; and one of another group.
  const std::array<double, 5> values = {0, 1, 1.5, 9, 1.2}, radii = {0.6, 0.6, 0.1, 0.5, 3};
  const std::array<int, 5> groups = {0, 0, 0, 0, 4};
  const std::array<double, 5> bounds = {1.6, 1.6, 2.1, 0.5, 3};
  std::array<BlockRoot, 5> roots;
  for (std::size_t i = 0; i < 5; ++i) {
    roots[i].value = values[i];
    roots[i].radius = radii[i];
    roots[i].block = static_cast<int>(i);
  }
  bound_roots(roots.data(), 5, groups);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(roots[i].bound, bounds[i], 1e-9) << i;
}

TEST(BlockEnclosure, OfAPerturbedBasisStillEncloses) {
  Random random(1001);
  for (const double perturbation : {1e-13, 1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1}) {
    SCOPED_TRACE(perturbation);
    int proved = 0;
    for (int trial = 0; trial < 40; ++trial) {
      const System<> system = random_system(random, random.integer(1, 6));
      Spectrum<> spectrum = analyze(system);
      Eigen::MatrixXd& U = spectrum.basis.U;
      U += perturbation * U.norm() / 5 * random.matrix(U.rows(), U.cols());
      BlockEnclosure<> enclosure;
      certify_as_is(system, trial % 2 == 0, spectrum, enclosure);
      if (std::isfinite(expect_enclosed(system, spectrum).widest)) ++proved;
    }
    if (perturbation <= 1e-6) {
      EXPECT_EQ(proved, 40);
    }
  }
}

TEST(BlockEnclosure, OfAPerturbedLambdaStillEncloses) {
  Random random(1002);
  for (int trial = 0; trial < 60; ++trial) {
    const System<> system = random_system(random, random.integer(2, 6));
    Spectrum<> spectrum = analyze(system);
    spectrum.basis.Lambda *= 1 + random.log_uniform(1e-12, 1e-2);
    BlockEnclosure<> enclosure;
    certify_as_is(system, true, spectrum, enclosure);
    expect_enclosed(system, spectrum);
  }
}

/// Two oscillators in the basis they have without the spring and the damper between them: these
/// move the eigenvalues by their square over the eigenvalues' distance, the bound's second-order
/// term.
TEST(BlockEnclosure, CountsTheSecondOrderOfTheDefect) {
  Random random(1003);
  Enclosed tightest;
  for (int trial = 0; trial < 200; ++trial) {
    System<> system(2);
    system.stiffness.diagonal() << 4, 4.5;
    Spectrum<> spectrum = analyze(system);
    const double coupling = random.log_uniform(1e-3, 2e-2);
    system.stiffness(0, 1) = system.stiffness(1, 0) = coupling;
    system.damping(0, 1) = system.damping(1, 0) = random.uniform(-coupling, coupling);
    BlockEnclosure<> enclosure;
    certify_as_is(system, true, spectrum, enclosure);
    const Enclosed seen = expect_enclosed(system, spectrum);
    tightest.tightest = std::max(tightest.tightest, seen.tightest);
    tightest.tightest_ratio = std::max(tightest.tightest_ratio, seen.tightest_ratio);
  }
  // The bounds are within sight of the errors here, so leaving that term out would show.
  EXPECT_GT(tightest.tightest, 0.01);
  EXPECT_GT(tightest.tightest_ratio, 0.01);
}

TEST(BlockEnclosure, HoldsForEveryMatrixWithinTheDefect) {
  Random random(1006);
  int groups_of_one = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int states = 2 * random.integer(1, 3);
    BasisResidual<> residual;
    ModalBasis<> basis;
    const Eigen::VectorXd lambda = -random.vector(states).cwiseAbs() * 3;
    basis.U = MatrixXd::Ones(states / 2, states);
    basis.Lambda = lambda.asDiagonal();
    basis.weight = MatrixXd::Identity(states, states);
    for (int i = 0; i < states; ++i) basis.blocks.push_back({i, 1, false});
    residual.F = MatrixXd::Zero(states, states);
    residual.F_error = random.log_uniform(1e-3, 0.3) * random.matrix(states, states).cwiseAbs();
    // Errors that all push together or apart are the worst.
    const double diagonal = random.log_uniform(1e-3, 1);
    residual.F_error.diagonal() = diagonal * random.vector(states).cwiseAbs();
    MatrixXd error = residual.F_error;
    for (Eigen::Index j = 0; j < states; ++j) {
      for (Eigen::Index i = 0; i < states; ++i) error(i, j) *= random.integer(0, 1) == 0 ? -1 : 1;
    }
    BlockEnclosure<> enclosure;
    enclose<kDynamic>(residual, basis, enclosure);
    const Eigen::VectorXcd exact = (MatrixXd(lambda.asDiagonal()) + error).eigenvalues();
    for (int group = 0; group < states; ++group) {
      int members = 0, inside = 0;
      for (int i = 0; i < states; ++i) members += enclosure.group[i] == group ? 1 : 0;
      for (const Complex& z : exact) {
        double away = kInfinity;
        for (int i = 0; i < states; ++i) {
          if (enclosure.group[i] == group) away = std::min(away, std::abs(z - lambda[i]));
        }
        if (away <= enclosure.radius[group] + 1e-12) ++inside;
      }
      EXPECT_GE(inside, members) << "trial " << trial << ", group " << group;
      groups_of_one += members == 1 ? 1 : 0;
    }
  }
  EXPECT_GT(groups_of_one, 500);
}

TEST(BlockEnclosure, OfAWrongBasisIsWideOrInfinite) {
  Random random(1004);
  for (int trial = 0; trial < 40; ++trial) {
    const int n = random.integer(2, 6);
    const System<> system = random_system(random, n), other = random_system(random, n);
    Spectrum<> spectrum = analyze(other);
    BlockEnclosure<> enclosure;
    certify_as_is(system, true, spectrum, enclosure);
    EXPECT_GT(expect_enclosed(system, spectrum).widest, 1e-3);
  }
}

TEST(BlockEnclosure, GroupsBlocksThatCannotBeSeparated) {
  System<> system(3);
  system.damping.diagonal() << 0.4, 0.4, 0.4;
  system.stiffness.diagonal() << 9, 9, 100;
  Spectrum<> spectrum = analyze(system);
  BlockEnclosure<> enclosure;
  certify_as_is(system, true, spectrum, enclosure);
  const auto& blocks = spectrum.basis.blocks;
  for (int i = 0; i < blocks.size(); ++i) {
    for (int j = 0; j < blocks.size(); ++j) {
      const auto frequency = [&](int k) {
        const Block& b = blocks[k];
        return spectrum.basis.Lambda.block(b.first, b.first, b.size, b.size).norm();
      };
      const bool alike = std::abs(frequency(i) - frequency(j)) < 1;
      EXPECT_EQ(enclosure.group[i] == enclosure.group[j], alike) << i << ", " << j;
      if (alike) {
        EXPECT_EQ(enclosure.radius[i], enclosure.radius[j]);
      }
    }
    EXPECT_LE(enclosure.group[i], i);
    EXPECT_LE(enclosure.radius[i], 1e-12);
  }
}

TEST(DiscRadius, IsTheRadiusOfASingleEigenvalue) {
  const Complex value(-1, 2);
  EXPECT_EQ(disc_radius(&value, 1, 0, 3, 1e-9), 1e-9);
  const std::array<Complex, 2> pair{Complex(-1, 2), Complex(-1, -2)};
  EXPECT_EQ(disc_radius(pair.data(), 2, 0, 3, 0), 0);
  EXPECT_EQ(disc_radius(pair.data(), 2, 0, 3, kInfinity), kInfinity);
}

TEST(DiscRadius, CoversEveryPerturbedEigenvalue) {
  Random random(1005);
  for (int trial = 0; trial < 400; ++trial) {
    const int size = random.integer(2, 5);
    MatrixXd block = random.matrix(size, size);
    if (trial % 2 == 0) {  // all but one Jordan block
      block = 1e-3 * random.matrix(size, size);
      block.diagonal().array() -= 1;
      block.diagonal(1).array() += 1;
      if (trial % 4 == 0) block = MatrixXd(block.triangularView<Eigen::Upper>());
    }
    const double radius = random.log_uniform(1e-10, 1e-1);
    MatrixXd change = random.matrix(size, size);
    if (trial % 8 == 0) {
      change.setZero();
      change(size - 1, 0) = 1;
    }
    change *= radius / change.norm();
    const Eigen::VectorXcd values = block.eigenvalues(), moved = (block + change).eigenvalues();
    Eigen::VectorXd radii(size);
    for (int i = 0; i < size; ++i) {
      radii[i] = disc_radius(values.data(), size, i, block.norm(), radius);
      EXPECT_GE(radii[i], radius);
    }
    for (const Complex& z : moved) {
      bool covered = false;
      for (int i = 0; i < size; ++i) {
        covered = covered || std::abs(z - values[i]) <= radii[i] * (1 + 1e-6) + 1e-13;
      }
      EXPECT_TRUE(covered) << z << ", radius " << radius;
    }
  }
}

/// prod |z - mu_j| <= radius (norm + d)^(k-1) at the border, and no longer 5 % outside of it.
TEST(DiscRadius, IsNoLargerThanItsInequalityAsks) {
  for (const double radius : {1e-300, 1e-12, 1e-3}) {
    const std::array<Complex, 4> values{Complex(-1, 0), Complex(-1.001, 0), Complex(-1.001, 1e-4),
                                        Complex(-2, 0)};
    constexpr double kNorm = 3;
    const double d = disc_radius(values.data(), 4, 1, kNorm, radius) / 1.05;
    const double norm = kNorm + std::abs(values[1]);
    double product = 1;
    for (const Complex& value : values) {
      product *= std::max(d, 0.5 * std::abs(values[1] - value)) / (norm + d);
    }
    EXPECT_TRUE(d < radius || product * (norm + d) <= radius) << d;
  }
}

TEST(DiscRadius, IsProportionalToTheRadiusWhereEigenvaluesAreFarApart) {
  const std::array<Complex, 2> pair{Complex(-1, 2), Complex(-1, -2)};
  EXPECT_LE(disc_radius(pair.data(), 2, 0, 3.2, 1e-10), 1e-8);
}

}  // namespace
}  // namespace dashpot::analysis
