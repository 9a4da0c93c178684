// phi_0 and phi_1 of blocks against what Arb proves, from |A t| = 1e-12 to 1e6.
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/phi_functions.hpp>
#if defined(DASHPOT_HAVE_ARB)
#include <dashpot/tests/support/certified_spectrum.hpp>
#endif
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using testing::near;

MatrixXd matrix2(double a, double b, double c, double d) {
  return (Matrix2d() << a, b, c, d).finished();
}

TEST(Phi, OfZeroIsOne) {
  EXPECT_EQ(phi(0, 0), 1.0);
  EXPECT_EQ(phi(1, 0), 1.0);
  EXPECT_TRUE(near(phi(1, MatrixXd::Zero(2, 2), 1.0), MatrixXd::Identity(2, 2), 0));
  EXPECT_TRUE(near(phi(1, MatrixXd::Zero(4, 4), 1.0), MatrixXd::Identity(4, 4), kEps));
}

TEST(Phi, OfALargeBlockWiderThanTheRangeOfNumbersIsFinite) {
  // e^(A t) = S diag(e^(-t), e^(-3 t), e^(-14 t)) S^-1; the eigenvalues lie up to 8 from their
  // mean.
  const Eigen::Matrix3d S{{1, 0, 0}, {2, 1, 0}, {0, 1, 1}},
      inverse{{1, 0, 0}, {-2, 1, 0}, {2, -1, 1}};
  const MatrixXd A = S * Eigen::Vector3d(-1, -3, -14).asDiagonal() * inverse;
  for (const double t : {10.0, 100.0, 300.0, 700.0, 1e3, 1e6, 1e9, 1e15}) {
    const Eigen::Vector3d values(std::exp(-t), std::exp(-3 * t), std::exp(-14 * t));
    const MatrixXd expected = S * values.asDiagonal() * inverse;
    EXPECT_TRUE(near(phi(0, A, t), expected, 1e-14 * (1 + t) * std::exp(-t))) << "t = " << t;
    EXPECT_TRUE(near(phi(1, A, t) * t, -A.inverse(), 1e-4)) << "t = " << t;
  }
  EXPECT_TRUE(near(phi(0, -A, 300.0).array().isNaN().cast<double>().matrix(), MatrixXd::Zero(3, 3),
                   0));  // too large for a number, and no worse
}

TEST(Phi, RunsBackwardsInTime) {
  for (const MatrixXd& A : {matrix2(0, 1, -1, -2.5), matrix2(-1, 1, 0.01, -1)}) {
    const MatrixXd there = phi(0, A, 2.0);
    const MatrixXd back = phi(0, A, -2.0);
    EXPECT_TRUE(near(there * back, Matrix2d::Identity(), 1e-14));
  }
}

TEST(EigenvaluePair, KeepsTheSmallRootOfAStronglyOverdampedBlock) {
  const EigenvaluePair pair = eigenvalue_pair(matrix2(0, 1, -1, -1e9));
  EXPECT_NEAR(pair.first.real(), -1e-9, 1e-24);
  EXPECT_NEAR(pair.second.real(), -1e9, 1e-6);
}

#if defined(DASHPOT_HAVE_ARB)
const std::vector<double> kTimes = {1e-12, 1e-8, 1e-4, 0.01, 0.3, 0.7, 1,
                                    1.5,   4,    20,   300,  1e4, 1e6};

/// phi_k(A t): exp(Z) or the top right block of exp([Z I; 0 0]).
MatrixXd reference_phi(int k, const MatrixXd& A, double t) {
  constexpr slong kBits = 400;
  const Eigen::Index n = A.rows(), size = n * (k + 1);
  testing::BallMatrix Z(size, size), time(MatrixXd::Constant(1, 1, t));
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) acb_set_d(Z.at(i, j), A(i, j));
  }
  acb_mat_scalar_mul_acb(Z.get(), Z.get(), time.at(0, 0), kBits);
  for (Eigen::Index i = 0; i < n * k; ++i) acb_one(Z.at(i, i + n));
  acb_mat_exp(Z.get(), Z.get(), kBits);
  return Z.rounded().topRightCorner(n, n).real();
}

/// A relative change of eps in A t alone changes phi_k by eps in its rational part and eps |A t| in
/// its exponential part. `margin` roundings are allowed.
void expect_accurate(const MatrixXd& A, double t, double margin = 16) {
  const double size = A.norm() * t;
  const double growth = reference_phi(0, A, t).cwiseAbs().maxCoeff();
  for (const int k : {0, 1}) {
    const MatrixXd reference = reference_phi(k, A, t);
    const double exponential_part = size * growth / std::pow(std::max(1.0, size), k);
    // Below the smallest normal number there is no relative accuracy.
    const double tolerance = margin * kEps * (reference.cwiseAbs().maxCoeff() + exponential_part) +
                             std::numeric_limits<double>::min();
    EXPECT_TRUE(near(phi(k, A, t), reference, tolerance))
        << "k = " << k << ", t = " << t << ", A =\n"
        << A;
  }
}

TEST(Phi, IsAccurateAtAllTimes) {
  for (const double t : kTimes) {
    expect_accurate(MatrixXd::Constant(1, 1, -1.0), t);
    expect_accurate(MatrixXd::Constant(1, 1, -0.3), t);
    expect_accurate(MatrixXd::Constant(1, 1, 0.2), std::min(t, 300.0));  // unstable
    expect_accurate(matrix2(0, 1, -1, 0), t);                            // undamped
    expect_accurate(matrix2(-1e-4, 1, -1, -1e-4), t);                    // lightly damped
    expect_accurate(matrix2(0, 1, -1, -1.4), t);                         // companion form
    expect_accurate(matrix2(-0.9, 0.4, -0.4, -0.9), t);                  // nearly critical
    expect_accurate(matrix2(0, 1, -1, -2.5), t);
    expect_accurate(matrix2(-1, 0.5, -0.5, -1e3), std::min(t, 1e4));  // strongly overdamped
    expect_accurate(matrix2(0.3, 0.7, 0.1, -1), std::min(t, 300.0));  // statically unstable
  }
}

TEST(Phi, IsSmoothThroughCriticalDamping) {
  for (const double t : kTimes) {
    for (const double gap : {0.0, 1e-16, -1e-16, 1e-8, -1e-8, 1e-3, -1e-3, 0.1, -0.1}) {
      expect_accurate(matrix2(-1, 1, gap, -1), t);
      expect_accurate(matrix2(-1, 1e3, 1e-3 * gap, -1), t);
    }
  }
}

TEST(Phi, OfAZeroModeBlockKeepsRelativeAccuracyOfEveryEntry) {
  for (const double t : kTimes) {
    for (const double a : {0.0, 1e-6, 0.5, 1.0, 40.0}) {
      const MatrixXd A = matrix2(0, 1, 0, -a);
      for (const int k : {0, 1}) {
        const MatrixXd reference = reference_phi(k, A, t);
        const MatrixXd computed = phi(k, A, t);
        for (const auto& [i, j] : {std::pair{0, 0}, {0, 1}, {1, 1}}) {
          const double slack = k == 0 ? 1 + a * t : 1;
          EXPECT_NEAR(computed(i, j), reference(i, j), 8 * kEps * slack * std::abs(reference(i, j)))
              << "k = " << k << ", a t = " << a * t << ", entry " << i << j;
        }
        EXPECT_EQ(computed(1, 0), 0.0);
      }
    }
  }
}

TEST(Phi, OfALargeDefectiveBlockIsAccurate) {
  MatrixXd pair_twice = MatrixXd::Zero(4, 4);
  pair_twice << -0.1, 1, 1, 0,  //
      -1, -0.1, 0, 1,           //
      0, 0, -0.1, 1,            //
      0, 0, -1, -0.1;
  MatrixXd triple = -MatrixXd::Identity(3, 3);
  triple(0, 1) = triple(1, 2) = 1;
  for (const double t : {1e-12, 1e-4, 0.3, 1.0, 5.0, 100.0, 1e4}) {
    expect_accurate(pair_twice, t, 100);
    expect_accurate(triple, t, 100);
  }
}

TEST(Phi, OfRandomBlocksIsAccurate) {
  testing::Random random(3);
  for (int i = 0; i < 300; ++i) {
    MatrixXd A = random.matrix(2, 2) - 2 * MatrixXd::Identity(2, 2);
    A -= std::max(0.0, eigenvalue_pair(A).first.real()) * MatrixXd::Identity(2, 2);
    A *= random.log_uniform(1e-3, 1e3);
    expect_accurate(A, random.log_uniform(1e-9, 1e2));
  }
}
#else
TEST(Phi, NeedsArb) {
  GTEST_SKIP() << "FLINT/Arb is not installed (libflint-arb-dev, libflint-dev)";
}
#endif

}  // namespace
}  // namespace dashpot::analysis
