// Eigenvalues by the double-shift QR iteration, beside those of Eigen in long double.
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;
using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

/// Eigenvalues of A, any matrix; empty if the iteration did not converge.
std::vector<Complex> eigenvalues_of(MatrixXd A) {
  std::vector<Complex> values(static_cast<std::size_t>(A.rows()));
  reduce_to_hessenberg(A);
  if (!hessenberg_eigenvalues(A, values.data())) values.clear();
  return values;
}

/// Largest distance when each computed value takes the nearest true one that is left.
double worst_distance(const std::vector<Complex>& computed, std::vector<Complex> truth) {
  if (computed.size() != truth.size()) return std::numeric_limits<double>::infinity();
  double worst = 0;
  for (const Complex& z : computed) {
    const auto nearest = std::min_element(
        truth.begin(), truth.end(),
        [&](const Complex& a, const Complex& b) { return std::abs(a - z) < std::abs(b - z); });
    worst = std::max(worst, std::abs(*nearest - z));
    truth.erase(nearest);
  }
  return worst;
}

std::vector<Complex> by_eigen(const MatrixXd& A) {
  const auto values =
      Eigen::EigenSolver<LongMatrix>(A.cast<long double>(), false).eigenvalues().eval();
  std::vector<Complex> result;
  for (const auto& z : values) result.emplace_back(z);
  return result;
}

MatrixXd random_rotation(Random& random, Eigen::Index n) {
  return random.matrix(n, n).householderQr().householderQ();
}

TEST(Hessenberg, IsASimilarMatrixOfThatForm) {
  Random random(701);
  for (int n = 1; n <= 20; ++n) {
    const MatrixXd A = random.matrix(n, n);
    MatrixXd H = A;
    reduce_to_hessenberg(H);
    for (Eigen::Index j = 0; j < n; ++j) {
      for (Eigen::Index i = j + 2; i < n; ++i) EXPECT_EQ(H(i, j), 0);
    }
    EXPECT_NEAR(H.norm(), A.norm(), 1e-13 * A.norm());
    EXPECT_NEAR(H.trace(), A.trace(), 1e-13 * A.norm());
    EXPECT_LE(worst_distance(by_eigen(H), by_eigen(A)), 1e-12 * A.norm());
  }
}

TEST(HessenbergQr, AgreesWithEigenAtEverySize) {
  Random random(702);
  for (int n = 1; n <= 40; ++n) {
    for (int trial = 0; trial < 5; ++trial) {
      const MatrixXd A = random.matrix(n, n);
      EXPECT_LE(worst_distance(eigenvalues_of(A), by_eigen(A)), 1e-12 * A.norm()) << "n = " << n;
    }
  }
}

TEST(HessenbergQr, GivesExactConjugatePairs) {
  Random random(703);
  for (int trial = 0; trial < 20; ++trial) {
    const std::vector<Complex> values = eigenvalues_of(random.matrix(11, 11));
    ASSERT_EQ(values.size(), 11U);
    for (const Complex& z : values) {
      EXPECT_EQ(std::count(values.begin(), values.end(), std::conj(z)),
                std::count(values.begin(), values.end(), z));
    }
  }
}

TEST(HessenbergQr, SplitsDefectiveEigenvaluesNoMoreThanRoundingDoes) {
  Random random(704);
  for (int size = 2; size <= 5; ++size) {
    for (int trial = 0; trial < 20; ++trial) {
      MatrixXd jordan = VectorXd::LinSpaced(9, -9, -1).asDiagonal();
      jordan.topLeftCorner(size, size).diagonal().setConstant(-3.5);
      jordan.topLeftCorner(size, size).diagonal(1).setOnes();
      const MatrixXd Q = random_rotation(random, 9);
      std::vector<Complex> truth(9);
      for (Eigen::Index i = 0; i < 9; ++i) truth[static_cast<std::size_t>(i)] = jordan(i, i);
      const double split = 10 * std::pow(1e-14, 1.0 / size);
      EXPECT_LE(worst_distance(eigenvalues_of(Q * jordan * Q.transpose()), truth), split) << size;
    }
  }
}

TEST(HessenbergQr, ConvergesForDefectiveComplexPairs) {
  Random random(705);
  for (int trial = 0; trial < 200; ++trial) {
    MatrixXd A = MatrixXd::Zero(8, 8);
    A.topLeftCorner(4, 4) << -1, 2, 1, 0, -2, -1, 0, 1, 0, 0, -1, 2, 0, 0, -2, -1;
    A.bottomRightCorner(4, 4).diagonal() << -1, -5, -0.1, -0.2;
    const MatrixXd Q = random_rotation(random, 8);
    const Complex z(-1, 2);
    EXPECT_LE(worst_distance(eigenvalues_of(Q * A * Q.transpose()),
                             {z, z, std::conj(z), std::conj(z), -1, -5, -0.1, -0.2}),
              1e-6);
  }
}

TEST(HessenbergQr, TakesGradedMatrices) {
  Random random(706);
  for (int trial = 0; trial < 20; ++trial) {
    const int n = random.integer(2, 16);
    const double decades = random.uniform(0, 12);
    const VectorXd scale =
        VectorXd::LinSpaced(n, 0, decades).unaryExpr([](double x) { return std::pow(10.0, -x); });
    const MatrixXd A = scale.asDiagonal() * random.matrix(n, n) * scale.asDiagonal();
    EXPECT_LE(worst_distance(eigenvalues_of(A), by_eigen(A)), 1e-13 * A.norm());
    const MatrixXd reversed = A.reverse();
    EXPECT_LE(worst_distance(eigenvalues_of(reversed), by_eigen(reversed)), 1e-13 * A.norm());
  }
}

TEST(HessenbergQr, TakesManyCriticalOscillatorsOfGradedFrequency) {
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
    EXPECT_LE(worst_distance(eigenvalues_of(A), truth), 1e-7 * A.norm()) << "n = " << n;
  }
}

TEST(HessenbergQr, FindsExactEigenvaluesOfTriangularAndCyclicMatrices) {
  MatrixXd triangular = MatrixXd::Ones(6, 6).triangularView<Eigen::Upper>();
  triangular.diagonal() = VectorXd::LinSpaced(6, -3, 2);
  EXPECT_EQ(worst_distance(eigenvalues_of(triangular), {-3, -2, -1, 0, 1, 2}), 0);
  EXPECT_EQ(worst_distance(eigenvalues_of(MatrixXd::Zero(5, 5)), {0, 0, 0, 0, 0}), 0);
  // A cyclic permutation stalls the iteration without exceptional shifts.
  MatrixXd cyclic = MatrixXd::Zero(6, 6);
  for (Eigen::Index i = 0; i < 6; ++i) cyclic((i + 1) % 6, i) = 1;
  EXPECT_LE(worst_distance(eigenvalues_of(cyclic), by_eigen(cyclic)), 1e-13);
}

TEST(HessenbergQr, SaysWhenItDoesNotConverge) {
  EXPECT_TRUE(
      eigenvalues_of(MatrixXd::Constant(6, 6, std::numeric_limits<double>::quiet_NaN())).empty());
}

}  // namespace
}  // namespace dashpot::analysis
