// The small factorisations by themselves: against their definitions, and where they give up.
#include <dashpot/controller/base/small_cholesky.hpp>
#include <dashpot/controller/vibration/spring_factors.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::near;
using testing::Random;

/// Symmetric, positive semidefinite, of a given rank, with integers for entries: exactly so.
MatrixXd of_rank(Random& random, int n, int rank) {
  MatrixXd root(n, rank);
  for (double& entry : root.reshaped()) entry = random.integer(-3, 3);
  return root * root.transpose();
}

TEST(SmallCholesky, IsTheFactorAndItsInverse) {
  Random random(341);
  for (int k = 0; k < 100; ++k) {
    const int n = std::array{1, 2, 6, 9, 16}[static_cast<std::size_t>(k % 5)];
    const MatrixXd A = random.spd(n), L = A.llt().matrixL();
    SmallCholesky factor;
    factor.compute(A, 1e-14);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j <= i; ++j) EXPECT_NEAR(factor.L(i, j), L(i, j), 1e-14);
      EXPECT_NEAR(factor.per_diagonal(i), 1 / L(i, i), 1e-13 / L(i, i));
    }
    const VectorXd x = random.vector(n);
    VectorXd y = x;
    factor.multiply_L(y.data());
    EXPECT_TRUE(near(y, L * x, 1e-12 * (1 + y.norm())));
    factor.solve_L(y.data());
    EXPECT_TRUE(near(y, x, 1e-12 * (1 + x.norm())));
    factor.multiply_LT(y.data());
    EXPECT_TRUE(near(y, L.transpose() * x, 1e-12 * (1 + y.norm())));
    factor.solve_LT(y.data());
    EXPECT_TRUE(near(y, x, 1e-12 * (1 + x.norm())));
  }
}

TEST(SmallCholesky, RaisesPivotsThatAreTooSmall) {
  SmallCholesky factor;
  factor.compute(Eigen::Matrix3d(Eigen::Vector3d(4, 1e-6, -1).asDiagonal()), 1e-4);
  EXPECT_DOUBLE_EQ(factor.L(0, 0), 2);
  EXPECT_DOUBLE_EQ(factor.L(1, 1), 1e-2);
  EXPECT_DOUBLE_EQ(factor.L(2, 2), 1e-2);
  factor.compute(Eigen::Matrix3d(Eigen::Vector3d(1.01e-4, 0.99e-4, 1).asDiagonal()), 1e-4);
  EXPECT_DOUBLE_EQ(factor.L(0, 0), std::sqrt(1.01e-4));
  EXPECT_DOUBLE_EQ(factor.L(1, 1), 1e-2);
}

TEST(SemidefiniteFactor, HasAsManyRowsAsTheRankLargestPivotFirst) {
  Random random(342);
  for (int rank = 0; rank <= 6; ++rank) {
    for (int k = 0; k < 20; ++k) {
      const Matrix6 A = of_rank(random, 6, rank);
      const Matrix6 W = semidefinite_factor(A);
      EXPECT_TRUE(near(W.transpose() * W, A, 1e-13 * (1 + A.norm())));
      const auto full = Eigen::FullPivLU<MatrixXd>(A).rank();  // of the random integers
      EXPECT_TRUE(W.bottomRows(6 - full).isZero(0)) << A;
      if (full > 0) {
        EXPECT_DOUBLE_EQ(W.row(0).cwiseAbs().maxCoeff(), std::sqrt(A.diagonal().maxCoeff()));
      }
    }
  }
}

TEST(SemidefiniteFactor, LeavesOutWhatIsBelowRounding) {
  // Left out up to 3 eps of the largest: 6.7e-16
  for (const auto& [small, rows] : {std::pair(5e-16, 1), std::pair(9e-16, 2)}) {
    const Eigen::Matrix3d A = Eigen::Vector3d(1, 0, small).asDiagonal();
    const Eigen::Matrix3d W = semidefinite_factor(A);
    EXPECT_EQ((W.rowwise().norm().array() > 0).count(), rows) << small;
  }
}

TEST(LowerCholesky, RefusesWhatIsNotDefiniteBeyondRounding) {
  Random random(343);
  for (int r = 1; r <= 6; ++r) {
    const MatrixXd A = random.spd(r);
    JointMatrix L = Matrix6::Constant(7);
    L.topLeftCorner(r, r) = A;
    ASSERT_TRUE(lower_cholesky(L, r));
    const MatrixXd lower = L.topLeftCorner(r, r).triangularView<Eigen::Lower>();
    EXPECT_TRUE(near(lower * lower.transpose(), A, 1e-14));
    if (r < 6) {
      EXPECT_TRUE((L.bottomRows(6 - r).array() == 7).all());
    }
    JointMatrix thin = of_rank(random, r, r - 1);
    EXPECT_FALSE(lower_cholesky(thin, r));
  }
  // At 16 n eps of the trace, wherever the small one is: 7.105e-15 of it for n = 2
  for (const auto& [share, definite] : {std::pair(6.97e-15, false), std::pair(7.25e-15, true)}) {
    for (const double size : {0.01, 1.0, 4.0}) {
      JointMatrix A = Eigen::Vector2d(size, share * size).asDiagonal();
      EXPECT_EQ(lower_cholesky(A, 2), definite) << share;
      A = Eigen::Vector2d(share * size, size).asDiagonal();
      EXPECT_EQ(lower_cholesky(A, 2), definite) << share;
    }
  }
}

TEST(Orthonormalize, TellsWhatIsLeftOfAVector) {
  Random random(344);
  for (int k = 0; k < 100; ++k) {
    std::array<JointVector, 3> Q;
    for (int i = 0; i < 3; ++i) {
      JointVector& y = Q[static_cast<std::size_t>(i)];
      y = random.vector(5);
      ASSERT_TRUE(orthonormalize(Q.data(), i, 1e-3, y));
      for (int j = 0; j <= i; ++j) {
        EXPECT_NEAR(Q[static_cast<std::size_t>(j)].dot(y), i == j ? 1 : 0, 1e-15);
      }
    }
    // The small remainder of a vector next to their span is orthogonal to all its digits.
    JointVector beside = random.vector(5);
    ASSERT_TRUE(orthonormalize(Q.data(), 3, 1e-3, beside));
    JointVector y = Q[0] - 2 * Q[1] + Q[2] + 1e-6 * beside;
    JointVector same = y;
    EXPECT_FALSE(orthonormalize(Q.data(), 3, 1.01e-6, same));
    ASSERT_TRUE(orthonormalize(Q.data(), 3, 0.99e-6, y));
    for (const JointVector& q : Q) EXPECT_NEAR(q.dot(y), 0, 1e-15);
    EXPECT_TRUE(near(y, beside, 1e-9));
  }
}

TEST(SpringFactor, FollowsItsMatrix) {
  Random random(345);
  SpringFactor factor;
  EXPECT_EQ(factor.rows(), 0);
  const Matrix6 whole = random.spd(6);
  Matrix6 other = whole;  // in the last entry alone
  other(5, 5) += 1;
  const auto along = [](int i) { return Matrix6(Vector6::Unit(i).asDiagonal()); };
  for (const Matrix6& K :
       {Matrix6(Matrix6::Zero()), along(5), along(0), whole, other, Matrix6(of_rank(random, 6, 2)),
        Matrix6(of_rank(random, 6, 2)), whole, Matrix6(Matrix6::Zero())}) {
    for (int again = 0; again < 2; ++again) {
      factor.update(K.data(), 6);
      const MatrixXd W = factor.matrix().topRows(factor.rows());
      EXPECT_TRUE(near(W.transpose() * W, K, 1e-13 * (1 + K.norm())));
      EXPECT_EQ(factor.rows(), Eigen::FullPivLU<MatrixXd>(K).rank());
    }
    if (factor.rows() == 6) {
      EXPECT_TRUE(factor.matrix().isUpperTriangular(0));
    }
  }
}

/// Appends W and reads it back.
void append(FactorRows& rows, const MatrixXd& W) {
  const int before = rows.size(), count = static_cast<int>(W.rows());
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < W.cols(); ++j) rows.at(i, j) = W(i, j);
  }
  rows.grow(count);
  ASSERT_EQ(rows.size(), before + count);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < W.cols(); ++j) EXPECT_EQ(rows.at_row(before + i, j), W(i, j));
  }
}

MatrixXd triangle(FactorRows& rows, int n) {
  rows.triangularize(n);
  EXPECT_EQ(rows.size(), n);
  MatrixXd R(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) R(i, j) = rows.at_row(i, j);
  }
  EXPECT_TRUE(R.isUpperTriangular(0));
  EXPECT_GE(R.diagonal().minCoeff(), 0);
  return R;
}

TEST(FactorRows, BecomeATriangleWithTheSameProduct) {
  Random random(346);
  FactorRows rows;
  EXPECT_EQ(rows.size(), 0);
  for (int k = 0; k < 100; ++k) {
    rows.clear();
    EXPECT_EQ(rows.size(), 0);
    MatrixXd W = random.matrix(random.integer(4, 20), 4);
    if (k % 3 == 1) W.col(k % 4).setZero();
    if (k % 3 == 2) W.row(k % 4).setZero();
    append(rows, W.topRows(W.rows() / 2));
    append(rows, W.bottomRows(W.rows() - W.rows() / 2));
    const MatrixXd R = triangle(rows, 4);
    EXPECT_TRUE(near(R.transpose() * R, W.transpose() * W, 1e-13 * (1 + W.squaredNorm())));
  }
}

// A column that is one entry and next to nothing else turns without cancellation.
TEST(FactorRows, KeepTheirDigitsWhereATriangleIsAlmostThere) {
  for (const double head : {0.5, -0.5, 2.0, -2.0}) {
    FactorRows rows;
    append(rows, Eigen::Matrix<double, 3, 2>{{head, 3.0}, {1e-12, 2.0}, {1e-12, -1.0}});
    const MatrixXd R = triangle(rows, 2);
    EXPECT_DOUBLE_EQ(R(0, 0), std::abs(head));
    EXPECT_NEAR(R(0, 1), std::copysign(3.0, head), 1e-11);
    EXPECT_NEAR(R(1, 1), std::sqrt(5), 1e-11);
  }
}

}  // namespace
}  // namespace dashpot::controller
