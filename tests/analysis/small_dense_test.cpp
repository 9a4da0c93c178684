// Elimination and orthogonalisation of small matrices.
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::near;
using testing::Random;

constexpr double kTiny = std::numeric_limits<double>::min();

TEST(Multiply, AgreesWithEigen) {
  Random random(804);
  for (int n = 0; n <= 2 * kMaxDof + 1; ++n) {
    const MatrixXd A = random.matrix(n, 5), B = random.matrix(5, 7);
    MatrixXd out;
    multiply(A, B, out);
    EXPECT_TRUE(near(out, A * B, 1e-14)) << "n = " << n;
  }
}

TEST(IsFinite, LooksAtEveryEntry) {
  for (const double value :
       {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
        std::numeric_limits<double>::quiet_NaN()}) {
    for (Eigen::Index i = 0; i < 15; ++i) {
      MatrixXd X = MatrixXd::Constant(5, 3, std::numeric_limits<double>::max());
      EXPECT_TRUE(is_finite(X));
      X(i) = value;
      EXPECT_FALSE(is_finite(X)) << i;
    }
  }
  EXPECT_TRUE(is_finite(MatrixXd(0, 0)));
}

TEST(SolveInPlace, AgreesWithEigen) {
  Random random(801);
  for (int n = 0; n <= 20; ++n) {
    const MatrixXd A = random.matrix(n, n), B = random.matrix(n, 3);
    MatrixXd factor = A, X = B;
    solve_in_place(factor, X, kTiny);
    if (n == 0) continue;
    EXPECT_TRUE(near(A * X, B, 1e-13 * A.norm() * X.norm())) << "n = " << n;
    const MatrixXd expected = A.partialPivLu().solve(B);
    const double condition = A.norm() * A.inverse().norm();
    EXPECT_TRUE(near(X, expected, 1e-15 * condition * X.norm())) << "n = " << n;
  }
}

TEST(SolveInPlace, TakesComplexMatrices) {
  Random random(802);
  MatrixXcd A(7, 7), B(7, 2);
  A.real() = random.matrix(7, 7);
  A.imag() = random.matrix(7, 7);
  B.real() = random.matrix(7, 2);
  B.imag() = random.matrix(7, 2);
  MatrixXcd factor = A, X = B;
  solve_in_place(factor, X, kTiny);
  EXPECT_TRUE(near(A * X, B, 1e-13 * A.norm() * X.norm()));
}

TEST(SolveInPlace, NeedsItsPivoting) {
  MatrixXd A(3, 3);
  A << 0, 2, 1, 1e-20, 1, 0, 3, 0, 1;
  const VectorXd x{{1, -2, 3}};
  VectorXd b = A * x;
  solve_in_place(A, b, kTiny);
  EXPECT_TRUE(near(b, x, 1e-15));
}

TEST(SolveInPlace, FindsTheNullVectorOfASingularMatrix) {
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

TEST(SolveInPlace, ReplacesPivotsThatAreTooSmall) {
  MatrixXd A = MatrixXd::Zero(2, 2);
  VectorXd b{{3, 5}};
  solve_in_place(A, b, 0.5);
  EXPECT_TRUE(near(b, VectorXd{{6, 10}}, 0));
}

TEST(Orthonormalize, KeepsTheSpansOfLeadingColumns) {
  Random random(804);
  for (const double angle : {1.0, 1e-5, 1e-10}) {
    const MatrixXd start = random.matrix(8, 4);
    MatrixXd S = start;
    S.col(2) = S.col(0) + S.col(1) + angle * S.col(2);
    const MatrixXd given = S;
    orthonormalize(S);
    EXPECT_TRUE(near(S.transpose() * S, MatrixXd::Identity(4, 4), 1e-14));
    const MatrixXd R = S.transpose() * given;
    EXPECT_TRUE(near(S * R, given, 1e-14));
    EXPECT_TRUE(
        near(MatrixXd(R.triangularView<Eigen::StrictlyLower>()), MatrixXd::Zero(4, 4), 1e-14));
  }
}

TEST(Orthonormalize, TakesHugeAndTinyColumns) {
  Random random(805);
  MatrixXd S = random.matrix(5, 3) * VectorXd{{1e200, 1, 1e-200}}.asDiagonal();
  orthonormalize(S);
  EXPECT_TRUE(near(S.transpose() * S, MatrixXd::Identity(3, 3), 1e-14));
}

}  // namespace
}  // namespace dashpot::analysis
