// Bounds that are proved for tracked bases, beside what rounding does; what becomes of the radii;
// columns that are balanced and rotated.
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>
#include <dashpot/analysis/tracker/tracked_enclosure.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <complex>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::LongMatrix;
using testing::Random;
using Long = long double;

Long wide(double x) {
  return static_cast<Long>(x);
}
MatrixXd dense(const PackedMatrix& X, int size) {
  return MatrixXd::NullaryExpr(size, size, [&](Eigen::Index i, Eigen::Index j) {
    return X(static_cast<int>(i), static_cast<int>(j));
  });
}
void pack(const MatrixXd& A, PackedMatrix& X) {
  for (int i = 0; i < A.rows(); ++i) {
    for (int j = 0; j < A.cols(); ++j) X(i, j) = A(i, j);
  }
}

/// Any two-sided basis of a random system: p modes, with a stiffness factor if p < n.
struct AnyBasis {
  System<kMaxDof> system;
  BlockEigenbasis basis;
  int size;

  AnyBasis(Random& random, int n, int p) : system(n), size(n + p) {
    system.mass = random.spd(n);
    system.damping = random.matrix(n, n);
    if (p < n) {
      system.stiffness_factor = random.matrix(p, n);
    } else {
      system.stiffness = random.matrix(n, n);
    }
    basis.two_sided = true;
    basis.modes = p;
    basis.zeros = n - p;
    basis.Z.width = basis.Y.width = packed_width(p, n - p);
    for (PackedMatrix* X : {&basis.Z, &basis.Y}) pack(random.matrix(size, size), *X);
    for (auto* entries : {&basis.l00, &basis.l01, &basis.l10, &basis.l11, &basis.rate}) {
      for (int i = 0; i < n; ++i) (*entries)[at(i)] = random.uniform(-9, 9);
    }
  }
  SymmetricPencil pencil() const { return symmetric_pencil(system); }
  MatrixXd S() const {
    MatrixXd result = MatrixXd::Identity(size, size);
    result.bottomRightCorner(system.dof(), system.dof()) = -system.mass;
    return result;
  }
  MatrixXd B() const {
    const Eigen::Index n = system.dof(), p = size - n;
    MatrixXd result = MatrixXd::Zero(size, size);
    result.bottomRightCorner(n, n) = system.damping;
    if (p < n) {
      result.topRightCorner(p, n) = system.stiffness_factor;
      result.bottomLeftCorner(n, p) = system.stiffness_factor.transpose();
    } else {
      result.topRightCorner(n, n).setIdentity();
      result.bottomLeftCorner(n, n) = system.stiffness;
    }
    return result;
  }
  std::vector<int> columns(int i) const {
    if (i >= basis.modes) return {basis.first(i)};
    return {basis.first(i), basis.second(i)};
  }
  MatrixXd Lambda() const {
    MatrixXd result = MatrixXd::Zero(size, size);
    for (int i = 0; i < basis.blocks(); ++i) {
      const auto own = columns(i);
      const Block2<double> b = i < basis.modes
                                   ? basis.block(i)
                                   : Block2<double>{basis.rate[at(i - basis.modes)], 0, 0, 0};
      result(own, own) =
          MatrixXd((Eigen::Matrix2d() << b.a, b.b, b.c, b.d).finished())
              .topLeftCorner(static_cast<int>(own.size()), static_cast<int>(own.size()));
    }
    return result;
  }
  /// Frobenius norms of the blocks of X.
  MatrixXd norms(const MatrixXd& X) const {
    return MatrixXd::NullaryExpr(
        basis.blocks(), basis.blocks(), [&](Eigen::Index i, Eigen::Index j) {
          return MatrixXd(X(columns(static_cast<int>(i)), columns(static_cast<int>(j)))).norm();
        });
  }
};

/// N = Y S Z and G = Y B Z - N Lambda, of any basis of any grading, have rounding errors within
/// their bounds; and these are not much wider than they have to be.
TEST(ResidualErrors, CoverWhatRoundingDoes) {
  Random random(8107);
  double share_of_G = 0, share_of_N = 0;
  const auto expect_below = [](double error, double bound, double& share) {
    EXPECT_LE(error, bound);
    if (error > 0) share = std::max(share, error / bound);
  };
  for (const auto& [n, p] : {std::pair(1, 1),
                             {2, 2},
                             {6, 6},
                             {7, 7},
                             {16, 16},
                             {2, 1},
                             {3, 2},
                             {7, 5},
                             {9, 4},
                             {16, 13}}) {
    for (int trial = 0; trial < (n < 10 ? 60 : 6); ++trial) {
      SCOPED_TRACE(std::to_string(n) + " joints, rank " + std::to_string(p));
      AnyBasis any(random, n, p);
      MatrixXd Y = dense(any.basis.Y, n + p), Z = dense(any.basis.Z, n + p);
      MatrixXd N, G;
      if (trial % 6 == 0) {  // as the tracker evaluates it
        TrackedResidual residual;
        for (PackedMatrix* X : {&residual.MV, &residual.image, &residual.R, &residual.G}) {
          X->items.fill(7);  // of another update
        }
        evaluate(any.pencil(), any.basis, residual);
        N = dense(residual.R, n + p);
        N.diagonal().head(p).array() += 1;
        N.diagonal().tail(n).array() -= 1;
        G = dense(residual.G, n + p);
        for (int i = 0; i < p; ++i) {
          const auto own = any.columns(i);
          EXPECT_EQ(MatrixXd(G(own, own)).norm(), 0);
        }
      } else {  // one part is far larger than all others
        const auto grade = [&](int bits) { return std::ldexp(1, random.integer(-bits, bits)); };
        for (int k = 0; k < n; ++k) {
          const double s = grade(9);
          any.system.mass.row(k) *= s, any.system.mass.col(k) *= s;
        }
        any.system.damping *= grade(20);
        any.system.stiffness *= grade(20);
        any.system.stiffness_factor *= grade(20);
        for (int i = 0; i < n + p; ++i) {
          Y.row(i).head(p) *= grade(20), Z.col(i).head(p) *= grade(20);
        }
        pack(Y, any.basis.Y);
        pack(Z, any.basis.Z);
        const double rate = grade(30);
        for (auto* entries :
             {&any.basis.l00, &any.basis.l01, &any.basis.l10, &any.basis.l11, &any.basis.rate}) {
          for (double& entry : *entries) entry *= rate;
        }
        N = Y * MatrixXd(any.S() * Z);
        G = Y * MatrixXd(any.B() * Z) - N * any.Lambda();
      }
      const LongMatrix Y_long = Y.cast<Long>(), Z_long = Z.cast<Long>();
      const LongMatrix exact_N = Y_long * (any.S().cast<Long>() * Z_long);
      const LongMatrix exact_G =
          Y_long * (any.B().cast<Long>() * Z_long) - exact_N * any.Lambda().cast<Long>();
      const MatrixXd of_N = any.norms((N.cast<Long>() - exact_N).cast<double>());
      const MatrixXd of_G = any.norms((G.cast<Long>() - exact_G).cast<double>());
      const ResidualErrors errors(any.pencil(), any.basis);
      EXPECT_TRUE(errors.in_range());
      for (int i = 0; i < any.basis.blocks(); ++i) {
        expect_below(of_N.row(i).norm(), errors.of_N(i), share_of_N);
        expect_below(of_G.col(i).norm(), errors.of_columns(i / 4 * 4)[i % 4], share_of_G);
        for (int j = 0; j < any.basis.blocks(); ++j) {
          expect_below(of_G(i, j), errors.of_G(i, j / 4 * 4)[j % 4], share_of_G);
        }
      }
      expect_below(of_N.norm(), errors.of_N(), share_of_N);
      expect_below(of_G.norm(), errors.of_G(), share_of_G);
    }
  }
  EXPECT_GT(share_of_G, 0.03);
  EXPECT_GT(share_of_N, 0.03);
}

// ------------------------------------------------------------------------------- symmetric systems

/// A symmetric system, a basis of p modes and n - p zero modes, and a residual made up by hand.
struct HandMade : AnyBasis {
  TrackedResidual residual;
  TrackedEnclosure enclosure;

  HandMade(Random& random, int n, int p) : AnyBasis(random, n, p) {
    basis.two_sided = false;
    system.damping = random.log_uniform(1e-2, 1e2) * random.spd(n);
    system.stiffness_factor = random.log_uniform(1e-2, 1e2) * random.matrix(p, n);
    for (PackedMatrix* X : {&residual.R, &residual.G}) set_zero(basis.Z.width, n + p, *X);
  }
  void prove() { enclose(pencil(), basis, residual, enclosure); }
};

TEST(TrackedEnclosure, HoldsForEveryGramMatrix) {
  // (r - 1) F = g for the one column of a zero mode: |F| = g / (1 - r), which is attained.
  Random random(2500);
  for (const double r : {1e-3, 0.05, 0.099}) {
    HandMade made(random, 2, 1);
    made.basis.l00[0] = made.basis.l11[0] = 0;
    made.basis.l01[0] = 100;
    made.basis.l10[0] = -100;
    made.basis.rate[0] = -1;
    set_zero(made.basis.Z.width, 3, made.basis.Z);
    made.residual.R(2, 2) = r;
    made.residual.G(2, 2) = 0.25;
    made.prove();
    const Long exact = 0.25L / (1 - wide(r));
    EXPECT_GE(wide(made.enclosure.radius[1]), exact) << r;
    EXPECT_LE(wide(made.enclosure.radius[1]), exact * (1 + 1e-8L)) << r;
  }
}

/// Errors of N are gamma (a a' + m m'). Errors of G are gamma (a b' + b a' + c m m') and the errors
/// of N Lambda (tracked_enclosure.hpp). A single block has a radius of G / (1 - N).
TEST(TrackedEnclosure, CountsRoundingErrorsOfTheResidual) {
  Random random(2501);
  int single = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const int n = random.integer(1, 4), p = random.integer(1, n);
    HandMade made(random, n, p);
    const auto& system = made.system;
    made.system.mass *= random.log_uniform(1e-2, 1e2);
    const MatrixXd Z = random.log_uniform(1, 1e7) * random.matrix(n + p, n + p);
    pack(Z, made.basis.Z);
    made.prove();
    const VectorXd s = system.mass.diagonal().cwiseSqrt(),
                   rates = made.norms(made.Lambda()).diagonal();
    const auto largest = [&](const MatrixXd& A) {
      return A.cwiseAbs().cwiseQuotient(s * s.transpose()).maxCoeff();
    };
    const double gamma = (2 * made.size + 16) * kUnit, mass = largest(system.mass);
    const MatrixXd V = Z.bottomRows(n).cwiseAbs().transpose();
    const VectorXd a = Z.topRows(p).colwise().norm(), m = std::sqrt(mass) * (V * s);
    const VectorXd b = V * system.stiffness_factor.colwise().norm().transpose();
    // The two columns of a mode count together: their lengths, before anything is added.
    const auto block = [&](const VectorXd& x) {
      return VectorXd(VectorXd::NullaryExpr(made.basis.blocks(), [&](Eigen::Index i) {
        return VectorXd(x(made.columns(static_cast<int>(i)))).norm();
      }));
    };
    const VectorXd x = block(b) + block(a).cwiseProduct(rates),
                   momenta = block(m).cwiseProduct(
                       VectorXd(rates.array() + largest(system.damping) / mass));
    const double N = gamma * (a.squaredNorm() + m.squaredNorm());
    const double G =
        gamma * (a.norm() * x.norm() + b.norm() * a.norm() + m.norm() * momenta.norm());
    EXPECT_NEAR(made.enclosure.roundoff_bound / G, 1, 1e-8) << "trial " << trial;
    if (n > 1 || N > 0.09) continue;
    EXPECT_NEAR(made.enclosure.radius[0] * (1 - N) / G, 1, 1e-8);
    ++single;
  }
  EXPECT_GT(single, 50);
}

TEST(TrackedEnclosure, ProvesNothingBeyondTheRangeOfNumbers) {
  // Products of such masses, and of such rates, may overflow or underflow.
  Random random(2503);
  for (const bool two_sided : {false, true}) {
    for (const auto& [mass, stiffness, rate] : {std::tuple{1e-121, 1e-121, 1.0},
                                                {1e121, 1e121, 1.0},
                                                {1.0, 1e122, 1.0},
                                                {1.0, 1.0, 1e-61},
                                                {1.0, 1.0, 1.0}}) {
      HandMade made(random, 1, 1);
      made.basis.two_sided = two_sided;
      made.system.mass.setConstant(mass);
      made.system.stiffness_factor.resize(0, 1);
      made.system.stiffness.setConstant(1, 1, stiffness);
      made.basis.l00[0] = made.basis.l11[0] = 0;
      made.basis.l01[0] = rate;
      made.basis.l10[0] = -rate;
      made.prove();
      EXPECT_EQ(std::isfinite(made.enclosure.radius[0]), mass == 1 && stiffness == 1 && rate == 1)
          << mass << ", " << stiffness << ", " << rate;
    }
  }
}

// ---------------------------------------------------------------- from radii to modes

/// The modes of blocks [a b; c d] with these radii and groups.
TrackedSpectrum modes_of(const std::vector<std::array<double, 4>>& blocks, double radius,
                         bool alone, double soft_frequency, std::array<bool, kMaxDof>& soft) {
  BlockEigenbasis basis;
  basis.modes = static_cast<int>(blocks.size());
  TrackedEnclosure enclosure;
  enclosure.reset(basis.modes);
  enclosure.radius.setConstant(radius);
  if (!alone) enclosure.group.setZero();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    basis.l00[i] = blocks[i][0], basis.l01[i] = blocks[i][1];
    basis.l10[i] = blocks[i][2], basis.l11[i] = blocks[i][3];
  }
  TrackedSpectrum spectrum;
  read_numbers(basis, enclosure, soft_frequency, soft, spectrum);
  return spectrum;
}

TEST(TrackedModes, RoundingErrorsOfEigenvaluesOfABlock) {
  Random random(2502);
  for (int trial = 0; trial < 300; ++trial) {  // near critical damping, where they are largest
    const double a = random.uniform(-2, -1), d = random.uniform(-2, -1), b = random.uniform(1, 2);
    const double c = -0.25 * (a - d) * (a - d) / b * (1 + random.log_uniform(1e-16, 1e-8));
    std::array<bool, kMaxDof> soft{};
    const TrackedSpectrum spectrum = modes_of({{a, b, c, d}}, 0, true, 0, soft);
    const Long half = (wide(a) - wide(d)) / 2;
    const std::complex<Long> root =
        std::sqrt(std::complex<Long>(half * half + wide(b) * wide(c), 0));
    const std::complex<Long> mean = (wide(a) + wide(d)) / 2;
    for (const Complex& value : spectrum.modes[0].eigenvalues) {
      const std::complex<Long> z(value);
      const Long error = std::min(std::abs(z - mean - root), std::abs(z - mean + root));
      EXPECT_LE(error, wide(spectrum.modes[0].error_bound)) << "trial " << trial;
    }
  }
}

TEST(TrackedModes, FrequenciesOfAGroupAreThoseOfTheUnionOfItsDiscs) {
  // Two modes of one group 1.5 radii apart: either eigenvalue may be 2.5 radii away.
  constexpr double kRadius = 1e-3;
  for (const bool alone : {true, false}) {
    std::array<bool, kMaxDof> soft{};
    const TrackedSpectrum spectrum =
        modes_of({{-0.1, 10, -10, -0.1}, {-0.1, 10 + 1.5 * kRadius, -10 - 1.5 * kRadius, -0.1}},
                 kRadius, alone, 0, soft);
    EXPECT_EQ(spectrum.modes[0].natural_frequency_bound > 2.4 * kRadius, !alone);
    EXPECT_EQ(spectrum.modes[0].error_bound > 3 * kRadius, !alone);  // 2.4 are a disc
  }
}

TEST(TrackedModes, ASoftModeStaysSoftUpToTwiceTheFrequency) {
  std::array<bool, kMaxDof> soft{};
  const auto kind_at = [&soft](double omega) {
    return modes_of({{-0.1, omega, -omega, -0.1}}, 1e-9, true, 1, soft).modes[0].kind;
  };
  EXPECT_EQ(kind_at(1.5), ModeKind::kUnderdamped);
  EXPECT_EQ(kind_at(0.9), ModeKind::kSoft);
  EXPECT_EQ(kind_at(1.5), ModeKind::kSoft);
  EXPECT_EQ(kind_at(2.1), ModeKind::kUnderdamped);
  EXPECT_EQ(kind_at(1.5), ModeKind::kUnderdamped);
}

// ---------------------------------------------------------------- columns of a basis

/// Y S Z of a block's rows and columns.
Eigen::Matrix2d metric_of(const AnyBasis& any, int i) {
  const auto own = any.columns(i);
  return (dense(any.basis.Y, any.size) * any.S() * dense(any.basis.Z, any.size))(own, own);
}

TEST(BalancedBasis, IsOrthonormalInTheEnergyOfEachBlockAndKeepsItsMetric) {
  Random random(8108);
  for (const auto& [n, p] : {std::pair(6, 6), {16, 16}, {7, 5}, {16, 13}}) {
    SCOPED_TRACE(std::to_string(n) + " joints, rank " + std::to_string(p));
    AnyBasis any(random, n, p);
    // Frequencies from 1 rad/s on; the last one below the least rate that counts.
    double largest = 0;
    for (int i = 0; i < p; ++i) {
      const double w = i + 1 < p ? 1 + 3 * i : 1e-5;
      any.basis.l00[at(i)] = any.basis.l11[at(i)] = 0;
      any.basis.l01[at(i)] = -w;
      any.basis.l10[at(i)] = w;
      largest = std::max(largest, w * w);
    }
    std::vector<Eigen::Matrix2d> before;
    for (int i = 0; i < p; ++i) before.push_back(metric_of(any, i));
    EXPECT_TRUE(balance(any.pencil(), true, any.basis));
    const VectorXd D = MatrixXd(any.system.mass).diagonal();
    for (int i = 0; i < p; ++i) {
      const double w2 = std::max(1e-6 * largest, any.basis.block(i).determinant());
      VectorXd energy(n + p);
      energy.head(p) = p < n ? VectorXd::Ones(p) : VectorXd(w2 * D);
      energy.tail(n) = D;
      const MatrixXd columns = dense(any.basis.Z, n + p)(Eigen::all, any.columns(i));
      const Eigen::Matrix2d gram = columns.transpose() * energy.asDiagonal() * columns;
      EXPECT_LT((gram - Eigen::Matrix2d::Identity()).norm(), 1e-12) << gram;
      // With the signs of Sigma rows and columns change by inverse matrices.
      const Eigen::Matrix2d after = metric_of(any, i);
      EXPECT_NEAR(after.determinant(), before[at(i)].determinant(),
                  1e-9 * std::max(1.0, std::abs(after.determinant())));
    }
    // Even blocks stay.
    const BlockEigenbasis balanced = any.basis;
    EXPECT_FALSE(balance(any.pencil(), false, any.basis));
    EXPECT_EQ(any.basis.Z.items, balanced.Z.items);
    // A column four times as long as the other is not; one two and a half times as long is.
    for (const double factor : {2.5, 4.0}) {
      any.basis = balanced;
      for (int row = 0; row < n + p; ++row) any.basis.Z(row, 1) *= factor;
      EXPECT_EQ(balance(any.pencil(), false, any.basis), factor > 3) << factor;
    }
  }
}

TEST(RotatedBasis, IsOrthogonalInTheEnergyMetricToo) {
  Random random(8109);
  for (const auto& [n, p] : {std::pair(6, 6), {7, 5}}) {
    SCOPED_TRACE(std::to_string(n) + " joints, rank " + std::to_string(p));
    AnyBasis any(random, n, p);
    any.basis.two_sided = false;
    // Columns with z'Sz = 1 and -1, orthogonal in S: each made by hand of an elastic and a kinetic
    // vector of unit energy, x = cosh e + sinh k, y = sinh e + cosh k.
    const MatrixXd L = Eigen::LLT<MatrixXd>(MatrixXd(any.system.mass)).matrixL();
    MatrixXd Z = MatrixXd::Zero(n + p, n + p);
    for (int i = 0; i < p; ++i) {
      const double tilt = random.uniform(-0.8, 0.8);
      const VectorXd elastic = random.vector(p).normalized();
      const VectorXd kinetic = L.transpose().inverse() * random.vector(n).normalized();
      Z.col(i) << std::cosh(tilt) * elastic, std::sinh(tilt) * kinetic;
      Z.col(p + i) << std::sinh(tilt) * elastic, std::cosh(tilt) * kinetic;
    }
    TrackedResidual residual;
    residual.MV.width = any.basis.Z.width;
    const MatrixXd momenta = -any.system.mass * Z.bottomRows(n);
    for (int row = 0; row < n + p; ++row) {
      for (int j = 0; j < n + p; ++j) {
        any.basis.Z(row, j) = Z(row, j);
        residual.MV(row, j) = row < p ? Z(row, j) : momenta(row - p, j);
      }
    }
    EXPECT_TRUE(rotate_hyperbolically(residual, 1e-3, any.basis));
    const MatrixXd after = dense(any.basis.Z, n + p);
    for (int i = 0; i < p; ++i) {
      const VectorXd x = after.col(i), y = after.col(p + i);
      const double elastic = x.head(p).dot(y.head(p));
      const double kinetic = x.tail(n).dot(any.system.mass * y.tail(n));
      EXPECT_NEAR(elastic + kinetic, 0, 1e-12);
      EXPECT_NEAR(elastic - kinetic, 0, 1e-12);  // still orthogonal in S
      EXPECT_NEAR(x.head(p).squaredNorm() - x.tail(n).dot(any.system.mass * x.tail(n)), 1, 1e-12);
    }
    // Blocks that are orthogonal to the tolerance are left alone.
    EXPECT_FALSE(rotate_hyperbolically(residual, 2, any.basis));
  }
}

}  // namespace
}  // namespace dashpot::analysis
