// Radii of blocks and discs of their eigenvalues, proved from the residual of a basis, enclose the
// truth, however bad the basis, and are not much wider than necessary.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/modes.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::LongComplex;
using testing::LongMatrix;
using testing::Random;
using testing::true_eigenvalues;
using Long = long double;

// -------------------------------------------------------------------------- radii of the blocks

/// Lambda of single eigenvalues, and a perturbation of it: F as computed, and a bound of its error.
struct Perturbed {
  ModalBasis<> basis;
  BasisResidual<> residual;
  BlockEnclosure<> enclosure;

  explicit Perturbed(const VectorXd& Lambda) {
    const Eigen::Index states = Lambda.size();
    basis.U = MatrixXd::Ones(states / 2, states);
    basis.Lambda = Lambda.asDiagonal();
    basis.weight = MatrixXd::Identity(states, states);
    for (int i = 0; i < states; ++i) basis.blocks.push_back({i, 1, false});
    residual.F = residual.F_error = MatrixXd::Zero(states, states);
  }
  int size() const { return static_cast<int>(basis.Lambda.rows()); }
  void prove() { enclose<kDynamic>(residual, basis, enclosure); }
  bool all_alone() const {
    bool alone = true;
    for (int i = 0; i < size(); ++i) alone = alone && enclosure.alone(i);
    return alone;
  }

  /// The matrix with this error, which has to be within F_error, is enclosed: each group has at
  /// least as many of its eigenvalues within the radius as it has blocks.
  void expect_enclosed(const MatrixXd& error) {
    ASSERT_TRUE((error.array().abs() <= residual.F_error.array()).all());
    const LongMatrix exact =
        basis.Lambda.cast<Long>() + residual.F.cast<Long>() + error.cast<Long>();
    const auto eigenvalues = Eigen::EigenSolver<LongMatrix>(exact, false).eigenvalues().eval();
    prove();
    for (int group = 0; group < size(); ++group) {
      const auto radius = static_cast<Long>(enclosure.radius[group]) + 1e-18L;
      const auto inside = [&](const LongComplex& z) {
        for (int i = 0; i < size(); ++i) {
          const LongComplex center = static_cast<Long>(basis.Lambda(i, i));
          if (enclosure.group[i] == group && std::abs(z - center) <= radius) return true;
        }
        return false;
      };
      EXPECT_GE(std::count_if(eigenvalues.begin(), eigenvalues.end(), inside),
                (enclosure.group.array() == group).count())
          << "group " << group << ", radius " << radius;
    }
  }
};

MatrixXd two_by_two(double a, double b, double c, double d) {
  return (Eigen::Matrix2d() << a, b, c, d).finished();
}

TEST(BlockEnclosure, HoldsInTheWorstCases) {
  struct Case {
    const char* what;
    std::array<double, 2> Lambda;
    MatrixXd F, error;
    double radius;  ///< of block 0; 0: any
    bool alone;
  };
  const MatrixXd none = MatrixXd::Zero(2, 2);
  const auto coupled = [](double e) { return two_by_two(0, e, -e, 0); };
  const double root = std::sqrt(2.0);
  for (const Case& c : {
           Case{"errors of the block", {-1, -3}, none, two_by_two(0.25, 0, 0, -0.125), 0.25, true},
           // The blocks move from 1 apart to 0.1 apart, where a coupling counts ten times as much.
           Case{"both move", {0, 1}, two_by_two(0.45, 0.03, -0.03, -0.45), none, 0, false},
           Case{"the first moves", {0, 1}, two_by_two(0.9, 0.03, -0.03, 0), none, 0, false},
           Case{"the second moves", {0, 1}, two_by_two(0, 0.03, -0.03, -0.9), none, 0, false},
           Case{"the same by errors",
                {0, 1},
                coupled(0.02),
                two_by_two(0.45, 0, 0, -0.45),
                0.45 + 0.0008 / (0.1 - 0.02 * root),
                true},
           // 4 e^2 < delta^2, delta = 1 - e sqrt(2): e < 0.2929.
           Case{"nearly meet", {0, 1}, coupled(0.29), none, 0.1682 / (1 - 0.29 * root), true},
           Case{"may meet", {0, 1}, coupled(0.296), none, 0.296 * root, false},
           Case{"within a group", {1, 1}, two_by_two(0, 0.1, 0.1, 0), none, 0.1 * root, false},
       }) {
    SCOPED_TRACE(c.what);
    Perturbed pair(VectorXd{{c.Lambda[0], c.Lambda[1]}});
    pair.residual.F = c.F;
    pair.residual.F_error = c.error.cwiseAbs();
    pair.expect_enclosed(c.error);
    if (c.radius == 0) continue;
    EXPECT_EQ(pair.enclosure.alone(0), c.alone);
    EXPECT_NEAR(pair.enclosure.radius[0], c.radius, 1e-8 * c.radius);
  }
}

/// By no more than it has to, and however the columns are scaled.
TEST(BlockEnclosure, HoldsForEveryMatrixWithinTheErrors) {
  Random random(1006);
  int apart = 0;
  double tightest = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    Perturbed all(-3 * random.vector(2 * random.integer(1, 3)).cwiseAbs());
    const Eigen::Index states = all.size();
    MatrixXd error = random.log_uniform(1e-3, 0.3) * random.matrix(states, states);
    error.diagonal() = random.log_uniform(1e-3, 1) * random.vector(states);
    all.residual.F_error = error.cwiseAbs();
    if (trial % 4 == 0) all.residual.F.diagonal() = 1e-3 * random.vector(states);  // rounded
    Perturbed scaled = all;
    all.expect_enclosed(error);
    if (!all.all_alone()) continue;
    ++apart;
    const double moved = std::abs(error(0, 0));
    tightest = std::max(tightest, moved / all.enclosure.radius[0]);
    const VectorXd scale =
        VectorXd::NullaryExpr(states, [&] { return std::ldexp(1, random.integer(-9, 9)); });
    for (MatrixXd* A : {&scaled.residual.F, &scaled.residual.F_error}) {
      *A = (scale.cwiseInverse().asDiagonal() * *A * scale.asDiagonal()).eval();
    }
    scaled.basis.weight = scale.cwiseAbs2().cwiseInverse().asDiagonal();
    scaled.prove();
    for (Eigen::Index i = 0; i < states; ++i) {
      EXPECT_NEAR(scaled.enclosure.radius[i], all.enclosure.radius[i],
                  1e-8 * all.enclosure.radius[i]);
    }
  }
  EXPECT_GT(apart, 100);
  EXPECT_GT(tightest, 0.9);
}

/// Slow blocks beside fast ones whose errors are far more than the slow ones are apart.
TEST(BlockEnclosure, CountsErrorsWhereTheyAct) {
  Random random(1047);
  int apart = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    VectorXd Lambda = -random.vector(6).cwiseAbs();
    Lambda.tail(3) *= random.log_uniform(1e2, 1e6);
    Perturbed all(Lambda);
    MatrixXd error = random.log_uniform(1e-4, 0.1) * random.matrix(6, 6);
    error.bottomLeftCorner(3, 3) *= random.log_uniform(1, 1e3);
    error.bottomRightCorner(3, 3) *= random.log_uniform(1, 1e5);
    all.residual.F_error = error.cwiseAbs();
    all.expect_enclosed(error);
    const double errors = error.bottomRows(3).norm();
    if (all.enclosure.alone(0) && errors > Lambda.head(3).norm()) ++apart;
  }
  EXPECT_GT(apart, 100);
}

TEST(BlockEnclosure, SeparatesBlocksUpToTheLimitOfTheTheorem) {
  // 4 |E12| |E21| = delta^2 within some units of the last place.
  Random random(5104);
  for (int trial = 0; trial < 1000; ++trial) {
    const double ratio = random.uniform(1, 2), wide = random.uniform(1, 2);
    const double e = wide / (2 * std::sqrt(ratio) + std::sqrt(1 + ratio * ratio));
    Perturbed pair(VectorXd{{0, wide * (1 + (trial % 2) * 3e-10)}});
    pair.residual.F << 0, e * (1 - random.integer(-9, 9) * kEps), e * ratio, 0;
    pair.prove();
    EXPECT_EQ(pair.all_alone(), trial % 2 == 1);
  }
}

TEST(BlockEnclosure, CountsErrorsOfAWideBlockInTheFrobeniusNorm) {
  Random random(2401);
  for (const bool zero_mode : {true, false}) {
    for (int trial = 0; trial < 50; ++trial) {
      Perturbed one(VectorXd::Zero(2));
      one.basis.Lambda = random.matrix(2, 2);
      one.basis.blocks.clear();
      one.basis.blocks.push_back({0, 2, zero_mode});
      one.residual.F = 1e-3 * random.matrix(2, 2);
      one.residual.F_error = 1e-3 * random.matrix(2, 2).cwiseAbs();
      // The F of a zero mode, whose form is kept, is an error too.
      MatrixXd lost = one.residual.F_error;
      if (zero_mode) lost += one.residual.F.cwiseAbs();
      const MatrixXd Lambda = one.basis.Lambda, F = one.residual.F;
      one.prove();
      EXPECT_NEAR(one.enclosure.radius[0], lost.norm() * (1 + 1e-9), 1e-9 * lost.norm());
      EXPECT_EQ(one.basis.Lambda, zero_mode ? Lambda : MatrixXd(Lambda + F));
    }
  }
}

TEST(BlockEnclosure, ProvesNothingFromWhatIsNoNumber) {
  for (const bool of_error : {true, false}) {
    Perturbed pair(VectorXd{{-1, -2}});
    (of_error ? pair.residual.F_error : pair.residual.F)(0, 0) = testing::kNan;
    pair.prove();
    for (const double radius : pair.enclosure.radius) EXPECT_EQ(radius, kInfinity);
  }
}

// ------------------------------------------------------------------------ bounds of whole spectra

System<> random_system(Random& random, int n) {
  return testing::system_from(random.spd(n), random.log_uniform(1e-2, 10) * random.spd(n),
                              40 * random.spd(n));
}

struct Enclosed {
  double widest = 0;    ///< largest error bound
  double tightest = 0;  ///< largest error / bound, of eigenvalues, and of damping ratios
  double tightest_ratio = 0;
};

/// Expects every eigenvalue of the spectrum's basis as it stands, and the frequency and ratio of
/// clearly complex pairs, within its bound.
Enclosed expect_enclosed(const System<>& system, bool extended, Spectrum<>& spectrum,
                         BlockEnclosure<>& enclosure) {
  BasisResidual<> residual;
  evaluate_residual<kDynamic>(system, spectrum.symmetric, extended, spectrum.basis, residual);
  enclose<kDynamic>(residual, spectrum.basis, enclosure);
  read_modes<kDynamic>(system, residual, enclosure, 0, spectrum);
  Enclosed seen;
  const std::vector<LongComplex> truth = true_eigenvalues(system);
  for (const Mode<>& mode : spectrum.modes) {
    const LongComplex value(mode.eigenvalues[0]);
    const LongComplex nearest = *testing::nearest_to(value, truth);
    const Long error = std::abs(nearest - value);
    EXPECT_LE(error, static_cast<Long>(mode.error_bound)) << "at " << mode.eigenvalues[0];
    seen.widest = std::max(seen.widest, mode.error_bound);
    if (!(mode.damped_frequency > 2 * mode.error_bound)) continue;
    const Long omega = std::abs(nearest), zeta = -nearest.real() / omega;
    const Long zeta_error = std::abs(static_cast<Long>(mode.damping_ratio) - zeta);
    EXPECT_LE(std::abs(static_cast<Long>(mode.natural_frequency) - omega),
              mode.natural_frequency_bound);
    EXPECT_LE(zeta_error, mode.damping_ratio_bound);
    seen.tightest = std::max(seen.tightest, static_cast<double>(error) / mode.error_bound);
    seen.tightest_ratio =
        std::max(seen.tightest_ratio, static_cast<double>(zeta_error) / mode.damping_ratio_bound);
  }
  return seen;
}

TEST(BlockEnclosure, OfAPerturbedBasisStillEncloses) {
  Random random(1001);
  BlockEnclosure<> enclosure;
  for (const double perturbation : {1e-13, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1}) {
    SCOPED_TRACE(perturbation);
    for (int trial = 0; trial < 20; ++trial) {
      const System<> system = random_system(random, random.integer(2, 6));
      Spectrum<> spectrum = analyze(system);
      Eigen::MatrixXd& U = spectrum.basis.U;
      U += perturbation * U.norm() / 5 * random.matrix(U.rows(), U.cols());
      const Enclosed seen = expect_enclosed(system, trial % 2 == 0, spectrum, enclosure);
      if (perturbation <= 1e-6) EXPECT_TRUE(std::isfinite(seen.widest));
      spectrum = analyze(system);
      spectrum.basis.Lambda *= 1 + perturbation;
      expect_enclosed(system, true, spectrum, enclosure);
    }
  }
  for (int trial = 0; trial < 20; ++trial) {  // the basis of another system
    const int n = random.integer(2, 6);
    Spectrum<> spectrum = analyze(random_system(random, n));
    const Enclosed seen = expect_enclosed(random_system(random, n), true, spectrum, enclosure);
    EXPECT_GT(seen.widest, 1e-3);
  }
}

/// Two oscillators in the basis they have without the spring and the damper between them: these
/// move the eigenvalues by their square over the eigenvalues' distance, the bound's second-order
/// term.
TEST(BlockEnclosure, CountsTheSecondOrderOfTheDefect) {
  Random random(1003);
  Enclosed tightest;
  BlockEnclosure<> enclosure;
  for (int trial = 0; trial < 100; ++trial) {
    System<> system(2);
    system.stiffness.diagonal() << 4, 4.5;
    Spectrum<> spectrum = analyze(system);
    const double coupling = random.log_uniform(1e-3, 2e-2);
    system.stiffness(0, 1) = system.stiffness(1, 0) = coupling;
    system.damping(0, 1) = system.damping(1, 0) = random.uniform(-coupling, coupling);
    const Enclosed seen = expect_enclosed(system, true, spectrum, enclosure);
    tightest.tightest = std::max(tightest.tightest, seen.tightest);
    tightest.tightest_ratio = std::max(tightest.tightest_ratio, seen.tightest_ratio);
  }
  EXPECT_GT(tightest.tightest, 0.01);
  EXPECT_GT(tightest.tightest_ratio, 0.01);
}

TEST(BlockEnclosure, GroupsBlocksThatCannotBeSeparated) {
  System<> system(3);
  system.damping.diagonal() << 0.4, 0.4, 0.4;
  system.stiffness.diagonal() << 9, 9, 100;
  Spectrum<> spectrum = analyze(system);
  BlockEnclosure<> enclosure;
  expect_enclosed(system, true, spectrum, enclosure);
  const auto& blocks = spectrum.basis.blocks;
  const auto frequency = [&](int k) {
    const Block& b = blocks[k];
    return spectrum.basis.Lambda.block(b.first, b.first, b.size, b.size).norm();
  };
  for (int i = 0; i < blocks.size(); ++i) {
    for (int j = 0; j < blocks.size(); ++j) {
      const bool alike = std::abs(frequency(i) - frequency(j)) < 1;
      EXPECT_EQ(enclosure.group[i] == enclosure.group[j], alike) << i << ", " << j;
      if (alike) EXPECT_EQ(enclosure.radius[i], enclosure.radius[j]);
    }
    EXPECT_LE(enclosure.group[i], i);
    EXPECT_LE(enclosure.radius[i], 1e-12);
  }
}

// ------------------------------------------------------------------- from a block to eigenvalues

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

TEST(DiscRadius, IsHardlyMoreThanEigenvaluesMove) {
  // The eigenvalues of a Jordan block with e in its corner are the k-th roots of e.
  for (const int size : {2, 3, 4, 6}) {
    const Eigen::ArrayXcd values = Eigen::ArrayXcd::Zero(size);
    for (const double e : {1e-12, 1e-6, 1e-3}) {
      const double disc = disc_radius(values.data(), size, 0, 1, e), root = std::pow(e, 1.0 / size);
      EXPECT_GE(disc, root) << size;
      EXPECT_LE(disc, 1.1 * root * (1 + root)) << size;
    }
  }
  // [g/2 N; e -g/2] with e = -share g^2 / (4 N): the eigenvalues meet at 0 for share = 1. With a
  // third eigenvalue they take another road.
  const double gap = 1e-3, N = 1;
  const std::array<Complex, 3> meeting{gap / 2, -gap / 2, 1};
  for (const int count : {2, 3}) {
    for (const double share : {0.5, 0.9, 1.0}) {
      const double disc = disc_radius(meeting.data(), count, 0, N, share * gap * gap / (4 * N));
      EXPECT_GE(disc, gap / 2 * (1 - std::sqrt(1 - share))) << share;
      EXPECT_LE(disc, (count == 2 ? 0.51 : 1.1) * share * gap) << share;
    }
  }
  // It is proportional to the radius if eigenvalues are far apart, and equal for a single one.
  const std::array<Complex, 2> pair{Complex(-1, 2), Complex(-1, -2)};
  EXPECT_LE(disc_radius(pair.data(), 2, 0, 3.2, 1e-10), 1e-8);
  EXPECT_EQ(disc_radius(pair.data(), 1, 0, 3, 1e-9), 1e-9);
  for (const double radius : {0.0, kInfinity}) {
    EXPECT_EQ(disc_radius(pair.data(), 2, 0, 3, radius), radius);
  }
}

TEST(RootBounds, AreTheFarthestPointsOfUnionsOfDiscs) {
  // Discs of one group: three that hang together, a fourth apart; and one of another group.
  const std::array<double, 5> values = {0, 1, 1.5, 9, 1.2}, radii = {0.6, 0.6, 0.1, 0.5, 3};
  const std::array<double, 5> bounds = {1.6, 1.6, 2.1, 0.5, 3};
  std::array<BlockRoot, 5> roots;
  for (std::size_t i = 0; i < 5; ++i) {
    roots[i].value = values[i];
    roots[i].radius = radii[i];
    roots[i].block = static_cast<int>(i);
  }
  bound_roots(roots.data(), 5, std::array<int, 5>{0, 0, 0, 0, 4});
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(roots[i].bound, bounds[i], 1e-9) << i;
  // Small discs inside of a wide one: rounding makes no bound too small.
  Random random(5108);
  for (int trial = 0; trial < 300; ++trial) {
    for (BlockRoot& root : roots) {
      root.value = {random.uniform(-1, 1), random.uniform(-1, 1)};
      root.radius = random.log_uniform(1e-20, 1e-3);
      root.block = 0;
    }
    roots[4].radius = modulus(roots[4].value) + 0.8;
    for (BlockRoot& root : roots) root.value *= trial % 2 == 0 ? 0.5 : 1.0;
    bound_roots(roots.data(), 5, std::array<int, 1>{0});
    for (const BlockRoot& root : roots) {
      for (const BlockRoot& other : roots) {
        if (other.united != root.united) continue;
        EXPECT_GE(static_cast<Long>(root.bound),
                  std::abs(LongComplex(root.value) - LongComplex(other.value)) +
                      static_cast<Long>(other.radius))
            << "trial " << trial;
      }
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
