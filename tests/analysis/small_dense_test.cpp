// Elimination and orthogonalisation of small matrices.
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/special_values.hpp>

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

}  // namespace
}  // namespace dashpot::analysis
