// The residual of a basis and its bound, the Sylvester solver's separation, and Newton's
// convergence.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::near;
using testing::Random;
using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

System<> random_system(Random& random, int n, bool symmetric) {
  System<> system(n);
  const MatrixXd skew = random.matrix(n, n);
  system.mass = random.spd(n);
  system.damping = random.spd(n);
  system.stiffness = 40 * random.spd(n);
  if (!symmetric) system.stiffness += skew - skew.transpose();
  return system;
}

/// Z^-1 A Z - Lambda = -Z^-1 [0; M^-1 R] in long double, with the state matrix A, Z = [U; U Lambda]
/// and the residual R = M U Lambda^2 + C U Lambda + K U.
LongMatrix true_defect(const System<>& system, const ModalBasis<>& basis) {
  const Eigen::Index n = system.dof();
  const LongMatrix U = basis.U.cast<long double>(), Lambda = basis.Lambda.cast<long double>();
  const LongMatrix M = system.mass.cast<long double>(), V = U * Lambda;
  const LongMatrix R = M * (V * Lambda) + system.damping.cast<long double>() * V +
                       system.stiffness.cast<long double>() * U;
  LongMatrix Z(2 * n, 2 * n), right(2 * n, 2 * n);
  Z << U, V;
  right << LongMatrix::Zero(n, 2 * n), -M.fullPivLu().solve(R);
  return Z.fullPivLu().solve(right);
}

TEST(BasisResidual, IsWithinItsErrorOfTheTrueOne) {
  Random random(901);
  for (int trial = 0; trial < 60; ++trial) {
    const bool symmetric = trial % 2 == 0;
    const bool extended = trial % 3 == 0;
    const System<> system = random_system(random, random.integer(1, 7), symmetric);
    ModalBasis<> basis = analyze(system).basis;
    const double perturbation = trial % 5 == 0 ? 0 : random.log_uniform(1e-14, 1e-3);
    basis.U += perturbation * random.matrix(basis.U.rows(), basis.U.cols());
    BasisResidual<> residual, working;
    evaluate_residual<kDynamic>(system, symmetric, false, basis, working);
    evaluate_residual<kDynamic>(system, symmetric, extended, basis, residual);
    const MatrixXd error =
        (true_defect(system, basis) - residual.F.cast<long double>()).cwiseAbs().cast<double>();
    ASSERT_TRUE(residual.F_error.allFinite());
    // Long double rounds 2048 times finer than double, and does so in the truth too.
    MatrixXd bound = residual.F_error;
    if (extended) bound += working.F_error / 500;
    for (Eigen::Index j = 0; j < error.cols(); ++j) {
      for (Eigen::Index i = 0; i < error.rows(); ++i) {
        EXPECT_LE(error(i, j), bound(i, j)) << i << ", " << j << (extended ? ", extended" : "");
      }
    }
    // Not so wide as to be of no use.
    if (perturbation < 1e-10) {
      EXPECT_LE(residual.F_error.norm(), 1e-8 * basis.Lambda.norm());
    }
  }
}

TEST(BasisResidual, OfADegenerateBasisIsUnbounded) {
  Random random(902);
  const System<> system = random_system(random, 3, true);
  ModalBasis<> basis = analyze(system).basis;
  basis.U.col(2) = basis.U.col(0);
  basis.Lambda.col(2).setZero();
  basis.Lambda.row(2).setZero();
  basis.Lambda(2, 2) = basis.Lambda(0, 0);
  BasisResidual<> residual;
  evaluate_residual<kDynamic>(system, true, false, basis, residual);
  EXPECT_FALSE((residual.F_error.array() < 1).all());
}

/// Smallest singular value of X -> A X - X B.
double true_separation(const MatrixXd& A, const MatrixXd& B) {
  const Eigen::Index k = A.rows(), l = B.rows();
  LongMatrix map = LongMatrix::Zero(k * l, k * l);
  for (Eigen::Index j = 0; j < l; ++j) {
    map.block(j * k, j * k, k, k) += A.cast<long double>();
    for (Eigen::Index i = 0; i < l; ++i) {
      map.block(j * k, i * k, k, k).diagonal().array() -= static_cast<long double>(B(i, j));
    }
  }
  return static_cast<double>(Eigen::JacobiSVD<LongMatrix>(map).singularValues().tail(1)[0]);
}

TEST(Sylvester, IsSolvedAndItsSeparationIsALowerBound) {
  Random random(903);
  for (int k = 1; k <= 4; ++k) {
    for (int l = 1; l <= 4; ++l) {
      SCOPED_TRACE(std::to_string(k) + " x " + std::to_string(l));
      for (int trial = 0; trial < 50; ++trial) {
        const State<kDynamic> A = random.matrix(k, k);
        State<kDynamic> B = random.matrix(l, l);
        // Every other time, all but a common eigenvalue.
        if (trial % 2 == 0 && k == l) {
          B = A + random.log_uniform(1e-12, 1e-1) * random.matrix(k, k);
        }
        const State<kDynamic> C = random.matrix(k, l);
        State<kDynamic> X;
        const double separation = solve_sylvester<kDynamic>(A, B, C, X);
        const double truth = true_separation(A, B);
        EXPECT_LE(separation, (1 + 1e-6) * truth + 1e-15);
        if (truth < 1e-3) continue;
        EXPECT_GT(separation, 1e-3 * truth);
        EXPECT_TRUE(near(A * X - X * B, C, 1e-11 * (1 + X.norm() / truth)));
      }
    }
  }
}

TEST(Sylvester, HasNoSolutionWhereEigenvaluesAreCommon) {
  Random random(904);
  for (int size = 1; size <= 2; ++size) {
    const State<kDynamic> A = random.matrix(size, size);
    State<kDynamic> X;
    EXPECT_EQ(solve_sylvester<kDynamic>(A, A, random.matrix(size, size), X), 0);
    EXPECT_TRUE(near(X, MatrixXd::Zero(size, size), 0));
  }
}

/// Largest block of F off the diagonal, over |Lambda|.
double coupling_of(const BasisResidual<>& residual, const ModalBasis<>& basis) {
  double largest = 0;
  for (const Block& a : basis.blocks) {
    for (const Block& b : basis.blocks) {
      if (a.first == b.first) continue;
      largest = std::max(largest, residual.F.block(a.first, b.first, a.size, b.size).norm());
    }
  }
  return largest / basis.Lambda.norm();
}

TEST(NewtonStep, ConvergesQuadratically) {
  Random random(905);
  for (const bool symmetric : {true, false}) {
    const System<> system = random_system(random, 5, symmetric);
    ModalBasis<> basis = analyze(system).basis;
    basis.U += 1e-4 * basis.U.norm() * random.matrix(5, 10) / 10;
    BasisResidual<> residual;
    BlockEnclosure<> enclosure;
    std::vector<double> sizes;
    for (int step = 0; step < 4; ++step) {
      evaluate_residual<kDynamic>(system, symmetric, true, basis, residual);
      sizes.push_back(coupling_of(residual, basis));
      enclose<kDynamic>(residual, basis, enclosure);
      newton_step<kDynamic>(residual, basis);
    }
    EXPECT_GT(sizes[0], 1e-6);
    EXPECT_LE(sizes[1], 1e3 * sizes[0] * sizes[0]) << sizes[0];
    EXPECT_LE(sizes[1], 1e-2 * sizes[0]) << sizes[0];
    EXPECT_LE(sizes[2], 1e3 * sizes[1] * sizes[1] + 1e-15) << sizes[1];
    EXPECT_LE(sizes[3], 1e-15);
  }
}

}  // namespace
}  // namespace dashpot::analysis
