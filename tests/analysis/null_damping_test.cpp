// Damping of the null space, against 33 digits.
#include <dashpot/analysis/null_damping.hpp>
#include <dashpot/tests/support/quad_matrix.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Quad;
using testing::quad_matrix;
using testing::QuadMatrix;
using testing::Random;

QuadMatrix transposed(const QuadMatrix& A) {
  QuadMatrix T(A[0].size(), std::vector<Quad>(A.size()));
  for (std::size_t i = 0; i < A.size(); ++i) {
    for (std::size_t j = 0; j < A[0].size(); ++j) T[j][i] = A[i][j];
  }
  return T;
}

QuadMatrix inverse(QuadMatrix A) {
  QuadMatrix B = quad_matrix(
      MatrixXd::Identity(static_cast<Eigen::Index>(A.size()), static_cast<Eigen::Index>(A.size())));
  testing::solve(A, B);
  return B;
}

/// N' D N with N = I - M^-1 J' (J M^-1 J')^-1 J.
QuadMatrix exact_null_space_damping(const MatrixXd& M, const MatrixXd& J, const MatrixXd& D) {
  const QuadMatrix JT = transposed(quad_matrix(J)), MJ = inverse(quad_matrix(M)) * JT;
  const QuadMatrix held = MJ * inverse(quad_matrix(J) * MJ) * quad_matrix(J);
  QuadMatrix N = quad_matrix(MatrixXd::Identity(M.rows(), M.rows()));
  for (std::size_t i = 0; i < N.size(); ++i) {
    for (std::size_t j = 0; j < N.size(); ++j) N[i][j] -= held[i][j];
  }
  return transposed(N) * quad_matrix(D) * N;
}

double worst_share(const QuadMatrix& exact, const NullSpaceDamping& found) {
  double worst = 0;
  for (Eigen::Index i = 0; i < found.damping.rows(); ++i) {
    for (Eigen::Index j = 0; j < found.damping.cols(); ++j) {
      const Quad truth = exact[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
      const double error =
          std::abs(static_cast<double>(truth - static_cast<Quad>(found.damping(i, j))));
      if (error > 0) worst = std::max(worst, error / found.error(i, j));
    }
  }
  return worst;
}

TEST(NullSpaceDamping, IsWithinItsError) {
  Random random(2105);
  double worst = 0;
  int tight = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = random.integer(2, 7), m = random.integer(1, n - 1);
    VectorXd scale(n);
    const double grade = trial % 2 == 0 ? 1 : 1e3;
    for (double& s : scale) s = random.log_uniform(1 / grade, grade);
    const MatrixXd M =
        testing::symmetrized(scale.asDiagonal() * random.spd(n) * scale.asDiagonal());
    const MatrixXd J = random.matrix(m, n);
    VectorXd stiffness(m), D(n);
    for (double& k : stiffness) k = random.log_uniform(1, 10 * grade);
    for (double& d : D) d = random.uniform(0, 10);
    const NullSpaceDamping found = null_space_damping(M, J, stiffness.asDiagonal(), D.asDiagonal());
    const double share = worst_share(exact_null_space_damping(M, J, D.asDiagonal()), found);
    EXPECT_LE(share, 1) << "n " << n << ", m " << m << ", trial " << trial;
    worst = std::max(worst, share);
    tight += found.error.norm() <= 1e-11 * found.damping.norm() ? 1 : 0;
  }
  EXPECT_GT(tight, 80);
  EXPECT_GT(worst, 0.005);
}

TEST(NullSpaceDamping, CountsTheErrorOfTheMass) {
  Random random(2106);
  double worst = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const int n = random.integer(2, 5), m = random.integer(1, n - 1);
    const MatrixXd M = random.spd(n), J = random.matrix(m, n);
    const MatrixXd error = random.log_uniform(1e-12, 1e-6) * random.spd(n).cwiseAbs();
    const MatrixXd D = random.vector(n).cwiseAbs().asDiagonal();
    MatrixXd truth = M;
    for (Eigen::Index j = 0; j < n; ++j) {
      for (Eigen::Index i = 0; i <= j; ++i) {
        truth(i, j) += (random.integer(0, 1) == 0 ? 0.999 : -0.999) * error(i, j);
        truth(j, i) = truth(i, j);
      }
    }
    const NullSpaceDamping found = null_space_damping(M, J, MatrixXd::Identity(m, m), D, error);
    if (!found.error.allFinite()) continue;
    const double share = worst_share(exact_null_space_damping(truth, J, D), found);
    EXPECT_LE(share, 1);
    worst = std::max(worst, share);
  }
  EXPECT_GT(worst, 1e-6);
}

TEST(NullSpaceDamping, TakesRoundedZerosOfTheSpringsForZeros) {
  // K_C has one direction, and its matrix is rounded. The other directions once had springs too, of
  // 1e-8 of its stiffness.
  Random random(2107);
  for (int trial = 0; trial < 50; ++trial) {
    const VectorXd direction = random.vector(3);
    const MatrixXd K_C = 1e3 * direction * direction.transpose();
    const MatrixXd M = random.spd(4), J = random.matrix(3, 4), D = MatrixXd::Identity(4, 4);
    const NullSpaceDamping found = null_space_damping(M, J, K_C, D);
    const MatrixXd one = direction.transpose() * J;
    const double share = worst_share(exact_null_space_damping(M, one, D), found);
    EXPECT_LE(share, 1);
    EXPECT_LE(found.error.norm(), 1e-9 * found.damping.norm());
  }
}

TEST(NullSpaceDamping, HasNoBoundWhereSpringsNearlyVanish) {
  MatrixXd J(2, 3);
  J << 1, 0, 0, 1, 1.7e-15, 0;  // is the second joint held?
  const auto bound = [&](const MatrixXd& mass_error) {
    return null_space_damping(MatrixXd::Identity(3, 3), J, MatrixXd::Identity(2, 2),
                              MatrixXd::Identity(3, 3), mass_error)
        .error;
  };
  EXPECT_FALSE(bound(MatrixXd::Constant(3, 3, 1e-16)).allFinite());
  // If the masses are exact, a long double of 113 digits (on ARM) can tell, one of 64 cannot.
  EXPECT_EQ(bound({}).allFinite(), std::numeric_limits<long double>::digits > 64);
}

}  // namespace
}  // namespace dashpot::analysis
