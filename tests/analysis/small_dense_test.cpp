// Elimination and orthogonalisation of small matrices.
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/special_values.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::LongComplex;
using testing::near;
using testing::Random;

constexpr double kTiny = std::numeric_limits<double>::min();

TEST(IsFinite, LooksAtEveryEntry) {
  for (const double value : {testing::kInfinity, -testing::kInfinity, testing::kNan}) {
    for (Eigen::Index i = 0; i < 15; ++i) {
      MatrixXd X = MatrixXd::Constant(5, 3, std::numeric_limits<double>::max());
      EXPECT_TRUE(is_finite(X));
      X(i) = value;
      EXPECT_FALSE(is_finite(X)) << i;
    }
  }
  EXPECT_TRUE(is_finite(MatrixXd(0, 0)));
}

/// A X = B is solved, with rows in any order.
template <class Matrix>
void expect_solved(const Matrix& A, const Matrix& B) {
  Matrix factor = A, X = B;
  solve_in_place(factor, X, kTiny);
  EXPECT_TRUE(near(A * X, B, 1e-13 * A.norm() * X.norm())) << A.rows() << " rows";
  if (A.rows() == 0) return;
  const double condition = A.norm() * A.inverse().norm();
  EXPECT_TRUE(near(X, A.partialPivLu().solve(B), 1e-15 * condition * X.norm()));
}

TEST(SolveInPlace, SolvesAndPivots) {
  Random random(801);
  for (int n = 0; n <= 2 * kMaxDof + 1; ++n) {
    const MatrixXd A = random.matrix(n, n), B = random.matrix(n, 3);
    expect_solved(A, B);
    MatrixXd product;
    multiply(A, B, product);
    EXPECT_TRUE(near(product, A * B, 1e-13)) << n << " rows";
    expect_solved<MatrixXcd>(A + Complex(0, 1) * random.matrix(n, n),
                             B + Complex(0, 1) * random.matrix(n, 3));
  }
  MatrixXd A(3, 3);
  A << 0, 2, 1, 1e-20, 1, 0, 3, 0, 1;
  expect_solved<MatrixXd>(A, A * VectorXd{{1, -2, 3}});
}

TEST(SolveInPlace, ReplacesPivotsThatAreTooSmallAndFindsANullVector) {
  MatrixXd zero = MatrixXd::Zero(2, 2);
  VectorXd b{{3, 5}};
  solve_in_place(zero, b, 0.5);
  EXPECT_TRUE(near(b, VectorXd{{6, 10}}, 0));
  Random random(803);
  for (int trial = 0; trial < 20; ++trial) {
    const int n = random.integer(1, 9);
    const VectorXd null = random.vector(n).normalized();
    const MatrixXd A = random.matrix(n, n) * (MatrixXd::Identity(n, n) - null * null.transpose());
    VectorXd x = VectorXd::Ones(n);
    for (int step = 0; step < 2; ++step) {
      MatrixXd factor = A;
      solve_in_place(factor, x, 1e-16 * (A.norm() + 1));
      ASSERT_TRUE(x.allFinite());
      x /= x.norm();
    }
    EXPECT_NEAR(std::abs(x.dot(null)), 1, 1e-12);
  }
}

TEST(Orthonormalize, KeepsTheSpansOfLeadingColumns) {
  Random random(804);
  for (const double angle : {1.0, 1e-5, 1e-10}) {
    MatrixXd S = random.matrix(8, 4);
    S.col(2) = S.col(0) + S.col(1) + angle * S.col(2);
    const MatrixXd given = S;
    orthonormalize(S);
    EXPECT_TRUE(near(S.transpose() * S, MatrixXd::Identity(4, 4), 1e-14));
    const MatrixXd R = S.transpose() * given;
    EXPECT_TRUE(near(S * R, given, 1e-14));
    EXPECT_TRUE(
        near(MatrixXd(R.triangularView<Eigen::StrictlyLower>()), MatrixXd::Zero(4, 4), 1e-14));
  }
  MatrixXd S = random.matrix(5, 3) * VectorXd{{1e200, 1, 1e-200}}.asDiagonal();
  orthonormalize(S);
  EXPECT_TRUE(near(S.transpose() * S, MatrixXd::Identity(3, 3), 1e-14));
}

// Eigenvalues by the double-shift QR iteration, beside known ones and Eigen's in long double.

/// Expects the eigenvalues of A within `tolerance` of `known`, or of Eigen's if empty: after the
/// reduction, which keeps them, and from it, in exact conjugate pairs.
void expect_eigenvalues(const MatrixXd& A, double tolerance,
                        const std::vector<Complex>& known = {}) {
  std::vector<LongComplex> truth(known.begin(), known.end());
  if (truth.empty()) truth = testing::eigenvalues_by_eigen(A.cast<long double>());
  MatrixXd H = A;
  reduce_to_hessenberg(H);
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    for (Eigen::Index i = j + 2; i < A.rows(); ++i) EXPECT_EQ(H(i, j), 0);
  }
  const auto kept = testing::eigenvalues_by_eigen(H.cast<long double>());
  EXPECT_LE(testing::worst_distance({kept.begin(), kept.end()}, truth), tolerance);
  std::vector<Complex> values(truth.size());
  ASSERT_TRUE(hessenberg_eigenvalues(H, values.data()));
  EXPECT_LE(testing::worst_distance(values, truth), tolerance) << A.rows() << " rows";
  for (const Complex& z : values) {
    EXPECT_EQ(std::count(values.begin(), values.end(), std::conj(z)),
              std::count(values.begin(), values.end(), z));
  }
}

MatrixXd turned(Random& random, const MatrixXd& A) {
  const MatrixXd Q = random.matrix(A.rows(), A.rows()).householderQr().householderQ();
  return Q * A * Q.transpose();
}

TEST(HessenbergQr, FindsEigenvaluesOfAnySizeAndGrading) {
  Random random(702);
  for (int n = 1; n <= 40; ++n) {
    const MatrixXd A = random.matrix(n, n);
    expect_eigenvalues(A, 1e-12 * A.norm());
  }
  for (int trial = 0; trial < 20; ++trial) {
    const int n = random.integer(2, 16);
    const VectorXd scale =
        Eigen::pow(10.0, -VectorXd::LinSpaced(n, 0, random.uniform(0, 12)).array());
    const MatrixXd A = scale.asDiagonal() * random.matrix(n, n) * scale.asDiagonal();
    for (const MatrixXd& given : {A, MatrixXd(A.reverse())}) {
      expect_eigenvalues(given, 1e-13 * A.norm());
    }
  }
  // [0 G; -G -2 G] has the double eigenvalues -G.
  for (int n = 1; n <= 8; ++n) {
    MatrixXd A = MatrixXd::Zero(2 * n, 2 * n);
    std::vector<Complex> truth;
    for (int i = 0; i < n; ++i) {
      const double omega = std::ldexp(1.0, 4 * i);
      A(i, n + i) = omega;
      A(n + i, i) = -omega;
      A(n + i, n + i) = -2 * omega;
      truth.insert(truth.end(), 2, -omega);
    }
    expect_eigenvalues(A, 1e-7 * A.norm(), truth);
  }
}

TEST(HessenbergQr, SplitsDefectiveEigenvaluesNoMoreThanRoundingDoes) {
  Random random(704);
  for (int trial = 0; trial < 80; ++trial) {
    const int size = 2 + trial % 4;
    MatrixXd jordan = VectorXd::LinSpaced(9, -9, -1).asDiagonal();
    jordan.topLeftCorner(size, size).diagonal().setConstant(-3.5);
    jordan.topLeftCorner(size, size).diagonal(1).setOnes();
    expect_eigenvalues(turned(random, jordan), 10 * std::pow(1e-14, 1.0 / size),
                       {jordan.diagonal().begin(), jordan.diagonal().end()});
  }
  for (int trial = 0; trial < 200; ++trial) {
    MatrixXd A = MatrixXd::Zero(8, 8);
    A.topLeftCorner(4, 4) << -1, 2, 1, 0, -2, -1, 0, 1, 0, 0, -1, 2, 0, 0, -2, -1;
    A.bottomRightCorner(4, 4).diagonal() << -1, -5, -0.1, -0.2;
    const Complex z(-1, 2);
    expect_eigenvalues(turned(random, A), 1e-6,
                       {z, z, std::conj(z), std::conj(z), -1, -5, -0.1, -0.2});
  }
}

TEST(HessenbergQr, FindsExactEigenvaluesOfTriangularAndCyclicMatrices) {
  MatrixXd triangular = MatrixXd::Ones(6, 6).triangularView<Eigen::Upper>();
  triangular.diagonal() = VectorXd::LinSpaced(6, -3, 2);
  expect_eigenvalues(triangular, 0, {-3, -2, -1, 0, 1, 2});
  expect_eigenvalues(MatrixXd::Zero(5, 5), 0, {0, 0, 0, 0, 0});
  // A cyclic permutation stalls the iteration without exceptional shifts.
  MatrixXd cyclic = MatrixXd::Zero(6, 6);
  for (Eigen::Index i = 0; i < 6; ++i) cyclic((i + 1) % 6, i) = 1;
  expect_eigenvalues(cyclic, 1e-13);
  MatrixXd none = MatrixXd::Constant(6, 6, testing::kNan);
  std::vector<Complex> values(6);
  EXPECT_FALSE(hessenberg_eigenvalues(none, values.data()));
}

// Double-double arithmetic against exact identities and long integers.

constexpr double kUnit = 0x1p-53;

/// high + low as a fraction of 2^-100, for numbers of order one: exact up to 2^27.
__extension__ using Wide = __int128;
Wide fixed_point(const DoubleDouble& x) {
  const auto part = [](double value) {
    return static_cast<Wide>(std::ldexp(value, 60)) * (Wide{1} << 40) +
           static_cast<Wide>(
               std::ldexp(std::ldexp(value, 60) - std::trunc(std::ldexp(value, 60)), 40));
  };
  return part(x.high) + part(x.low);
}
Wide magnitude(Wide x) {
  return x < 0 ? -x : x;
}

TEST(TwoSum, IsExactForAnyOrderOfMagnitudes) {
  EXPECT_EQ(two_sum(1.0, kUnit / 2), DoubleDouble(1.0, kUnit / 2));
  EXPECT_EQ(two_sum(kUnit / 2, 1.0), DoubleDouble(1.0, kUnit / 2));
  EXPECT_EQ(two_sum(1e20, -1e20), DoubleDouble(0.0, 0.0));
  testing::Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const double a = random.uniform(-1, 1);
    const double b = random.uniform(-1, 1) * std::ldexp(1.0, random.integer(-40, 0));
    EXPECT_EQ(fixed_point(two_sum(a, b)), fixed_point(a) + fixed_point(b));
  }
}

TEST(TwoProduct, IsExact) {
  const double a = 1 + 0x1p-30;
  EXPECT_EQ(two_product(a, a), DoubleDouble(1 + 0x1p-29, 0x1p-60));
}

TEST(DoubleDoubleProduct, KeepsThirtyDigits) {
  const DoubleDouble third(1.0 / 3, std::fma(-1.0 / 3, 3.0, 1.0) / 3);
  EXPECT_LE(std::abs((third * 3.0 - DoubleDouble(1)).high), 8 * kUnit * kUnit);
  EXPECT_LE(std::abs((third * third * 9.0 - DoubleDouble(1)).high), 16 * kUnit * kUnit);
}

TEST(DoubleDoubleSum, KeepsThirtyDigitsUnderCancellation) {
  testing::Random random(2);
  for (int i = 0; i < 1000; ++i) {
    const DoubleDouble a = two_sum(random.uniform(-1, 1), random.uniform(-1, 1) * kUnit / 4);
    const DoubleDouble b = two_sum(-a.high, random.uniform(-1, 1) * 0x1p-30);
    const Wide error = fixed_point(a + b) - fixed_point(a) - fixed_point(b);
    EXPECT_LE(magnitude(error), 4) << "in 2^-100";
  }
}

TEST(DoubleDoubleSum, TakesNegativesAndDoubles) {
  const DoubleDouble a(1.0, kUnit / 4);
  EXPECT_EQ(a - a, DoubleDouble(0));
  EXPECT_EQ(a + (-1.0), DoubleDouble(kUnit / 4));
  DoubleDouble sum = a;
  sum += a;
  EXPECT_EQ(sum, a * 2.0);
  sum = sum - a;
  EXPECT_EQ(sum, a);
}

TEST(DotAccumulator, KeepsWhatEachProductLoses) {
  DotAccumulator sum;
  sum.add(1 + 0x1p-30, 1 + 0x1p-30);
  sum.add(-1.0, 1 + 0x1p-29);
  EXPECT_EQ(sum.value(), DoubleDouble(0x1p-60));
}

TEST(DotAccumulator, FindsWhatWorkingPrecisionLoses) {
  DotAccumulator sum;
  sum.add(1e16, 1.0);
  sum.add(1.0, 1.0);
  sum.add(-1e16, 1.0);
  sum.add(DoubleDouble(0.5, kUnit / 8), 2.0);
  EXPECT_EQ(sum.value(), DoubleDouble(2.0, kUnit / 4));
}

}  // namespace
}  // namespace dashpot::analysis
