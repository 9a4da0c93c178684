// Eigenvalues by the double-shift QR iteration, beside known ones and Eigen's in long double.
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::LongComplex;
using testing::Random;

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

}  // namespace
}  // namespace dashpot::analysis
