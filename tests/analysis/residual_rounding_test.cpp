// The bounds of a basis's residual and of its Gram matrix, against both with 33 digits: never less,
// and attained where errors of coefficients are.
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>
#include <dashpot/tests/support/quad_spectrum.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::LongMatrix;
using testing::Quad;
using testing::quad_matrix;
using testing::QuadMatrix;
using testing::Random;

/// Largest shares of a bound that an error takes: of F_error by F* - F, with F* = -G^-1 Y' R, and
/// of E by weight G - I.
struct Shares {
  double F = 0, E = 0;
};

/// `off`: what the true coefficients differ by from the given ones.
Shares expect_bounded(const System<>& system, const System<>& off, const ModalBasis<>& basis,
                      const BasisResidual<>& residual) {
  const QuadMatrix M = quad_matrix(system.mass) + quad_matrix(off.mass);
  const QuadMatrix C = quad_matrix(system.damping) + quad_matrix(off.damping);
  const QuadMatrix K = quad_matrix(system.stiffness) + quad_matrix(off.stiffness);
  const QuadMatrix Lambda = quad_matrix(basis.Lambda), U = quad_matrix(basis.U), V = U * Lambda;
  const QuadMatrix Y = quad_matrix(basis.Y.transpose()), YG = quad_matrix(residual.YG.transpose());
  QuadMatrix G = Y * (C * U + M * V) + YG * (M * U), F = Y * (K * U + C * V + M * (V * Lambda));
  const QuadMatrix wG = quad_matrix(basis.weight) * G;
  testing::solve(G, F);
  Shares shares;
  const auto take = [](Quad error, double bound, double& largest) {
    const Quad size = error < 0 ? -error : error;
    EXPECT_TRUE(size <= static_cast<Quad>(bound)) << static_cast<double>(size) << " > " << bound;
    if (bound > 0)
      largest = std::max(largest, static_cast<double>(size / static_cast<Quad>(bound)));
  };
  for (int i = 0; i < basis.U.cols(); ++i) {
    for (int j = 0; j < basis.U.cols(); ++j) {
      take(-F[at(i)][at(j)].re - static_cast<Quad>(residual.F(i, j)), residual.F_error(i, j),
           shares.F);
      take(wG[at(i)][at(j)].re - (i == j ? 1 : 0), residual.E(i, j), shares.E);
    }
  }
  return shares;
}

/// F_error is no less than what its parts make exactly: |w| |Y|' r + max E sum (|F| + ...) / (1 -
/// s).
void expect_no_less_than_its_parts(const ModalBasis<>& basis, const BasisResidual<>& residual) {
  const auto wide = [](const MatrixXd& A) { return LongMatrix(A.cwiseAbs().cast<long double>()); };
  const LongMatrix E = wide(residual.E);
  const LongMatrix of_R = wide(basis.weight) * wide(basis.Y.transpose()) * wide(residual.R_size);
  const LongMatrix sums =
      (wide(residual.F) + of_R).colwise().sum() / (1 - E.colwise().sum().maxCoeff());
  const LongMatrix exact = of_R + E.rowwise().maxCoeff() * sums;
  EXPECT_TRUE((wide(residual.F_error).array() >= exact.array()).all());
}

/// A difference from given coefficients: none.
System<> none(int n) {
  System<> off(n);
  off.mass.setZero();
  return off;
}

TEST(ResidualRounding, OfAnyBasisIsCounted) {
  // Every other time [K C] is made for the basis: the residual is no more than rounding errors.
  Random random(5201);
  for (int trial = 0; trial < 900; ++trial) {
    const int n = random.integer(1, 3);
    ModalBasis<> basis;
    basis.U = random.matrix(n, 2 * n);
    basis.Lambda = MatrixXd::Zero(2 * n, 2 * n);
    for (int first = 0; first < 2 * n;) {
      const int size = std::min(random.integer(1, 3), 2 * n - first);
      basis.blocks.push_back({first, size, false});
      basis.Lambda.block(first, first, size, size) = random.matrix(size, size);
      first += size;
    }
    System<> system(n);
    system.mass = random.spd(n);
    system.damping = random.matrix(n, n);
    system.stiffness = random.matrix(n, n);
    if (trial % 3 == 0) {  // one part of the Gram matrix is far larger than the others
      for (Eigen::Index j = 0; j < 2 * n; ++j) {
        basis.Lambda.col(j) *= std::ldexp(1, random.integer(-12, 0));
      }
      system.damping *= std::ldexp(1, random.integer(-24, 0));
    }
    if (trial % 4 < 2) {
      MatrixXd Z(2 * n, 2 * n);
      Z << basis.U, basis.U * basis.Lambda;
      const MatrixXd KC =
          -system.mass * basis.U * basis.Lambda * basis.Lambda * Z.fullPivLu().inverse();
      system.stiffness = KC.leftCols(n);
      system.damping = KC.rightCols(n);
    }
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, false, trial % 2 == 0, basis, residual);
    expect_bounded(system, none(n), basis, residual);
    if (residual.F_error.allFinite()) expect_no_less_than_its_parts(basis, residual);
  }
}

TEST(ResidualRounding, OfForcesOfDampersThatCancel) {
  // Two slow motions in a direction in which only the rounding errors of C are left.
  Random random(5205);
  int proved = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix2d directions = random.matrix(2, 2);
    const Eigen::Vector4d rates(-0x1p-30, -0x1p-29, -2, -0x1p-60);
    const Eigen::Vector2d c(-rates[0] - rates[1], -rates[2] - rates[3]);
    const Eigen::Vector2d k(rates[0] * rates[1], rates[2] * rates[3]);
    System<> system(2);
    system.damping = directions * c.asDiagonal() * directions.inverse();
    system.stiffness = directions * k.asDiagonal() * directions.inverse();
    ModalBasis<> basis;
    basis.U = MatrixXd(2, 4);
    basis.U << directions.col(0), directions.col(0), directions.col(1), directions.col(1);
    basis.Lambda = rates.asDiagonal();
    for (int i = 0; i < 4; ++i) basis.blocks.push_back({i, 1, false});
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, false, false, basis, residual);
    if (!residual.F_error.allFinite()) continue;
    ++proved;
    expect_bounded(system, none(2), basis, residual);
  }
  EXPECT_GT(proved, 100);
}

TEST(ResidualRounding, OfWideBlocksIsThatOfTheirSums) {
  // k u for each sum of k products: of weight G one, of M U Lambda^2 two, and n u.
  Random random(5206);
  const int n = 8, k = 2 * n;
  System<> system(n);
  system.mass = random.spd(n);
  ModalBasis<> basis;
  basis.U = random.matrix(n, k);
  basis.Lambda = random.matrix(k, k);
  basis.blocks.push_back({0, k, false});
  BasisResidual<> residual;
  evaluate_residual<kDynamic>(system, false, true, basis, residual);
  const MatrixXd gram = k * kUnit * basis.weight.cwiseAbs() * residual.gram.cwiseAbs();
  EXPECT_TRUE((residual.E.array() >= gram.array()).all());
  evaluate_residual<kDynamic>(system, false, false, basis, residual);
  const MatrixXd size = basis.Lambda.cwiseAbs();
  const MatrixXd sums =
      (2 * k + n) * kUnit * system.mass.cwiseAbs() * basis.U.cwiseAbs() * size * size;
  EXPECT_TRUE((residual.R_size.array() >= sums.array()).all());
}

TEST(ResidualRounding, OfSumsThatCancelToTheLastDigit) {
  // One joint with c = -(l1 + l2), k = l1 l2 in two words each: what is left of R, and of the Gram
  // matrix off its diagonal, are the rounding errors of the double-double arithmetic.
  Random random(5202);
  for (int trial = 0; trial < 400; ++trial) {
    const double first = random.uniform(-2, -1), second = random.uniform(-4, -3);
    const DoubleDouble c = two_sum(-first, -second), k = two_product(first, second);
    System<> system = testing::one_joint(1, c.high, k.high), low = none(1);
    low.damping(0, 0) = c.low * (1 + random.integer(-2, 2) * kEps);
    low.stiffness(0, 0) = k.low * (1 + random.integer(-2, 2) * kEps);
    system.has_low_words = true;
    system.damping_low = low.damping;
    system.stiffness_low = low.stiffness;
    ModalBasis<> basis;
    // Y Lambda is rounded to doubles, and is what stands in the Gram matrix: of a 1 it is exact.
    basis.U = Eigen::RowVector2d(1, random.uniform(1, 2));
    basis.Lambda = Eigen::Vector2d(first, second).asDiagonal();
    basis.blocks.push_back({0, 1, false});
    basis.blocks.push_back({1, 1, false});
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, true, true, basis, residual);
    EXPECT_LE(residual.F_error.maxCoeff(), 1e-27);
    expect_bounded(system, low, basis, residual);
  }
}

TEST(ResidualRounding, OfResidualsThatAreNearlyOrthogonalToALeftVector) {
  // R = K U - 2 U here, nearly orthogonal to the left vector of a short column: the products with
  // it are rounding errors of R and of their own, far larger than the rest of the column of F.
  Random random(5203);
  for (int trial = 0; trial < 200; ++trial) {
    System<> system(2);
    system.damping = 3 * MatrixXd::Identity(2, 2);
    const double p = random.uniform(0, 1), q = random.uniform(0, 1);
    system.stiffness << 2 + p, q, -p, 2 - q;
    ModalBasis<> basis;
    basis.U = MatrixXd(2, 4);
    basis.U << 1, 1, 1, 1, 1, -1, 1, -1;
    basis.Lambda = Eigen::Vector4d(-1, -1, -2, -2).asDiagonal();
    basis.U.col(0) *= 0x1p-10;
    for (int i = 0; i < 4; ++i) basis.blocks.push_back({i, 1, false});
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, false, true, basis, residual);
    ASSERT_TRUE(residual.F_error.allFinite());
    expect_bounded(system, none(2), basis, residual);
  }
}

TEST(ResidualRounding, ErrorsOfCoefficientsAreAttained) {
  // An undamped joint in a block of two columns, of which only one has a residual.
  Random random(5204);
  for (int trial = 0; trial < 400; ++trial) {
    const double k = random.uniform(2, 3), error = random.uniform(0.01, 0.09);
    System<> system = testing::one_joint(1, 0, k), off = none(1);
    ModalBasis<> basis;
    basis.U = Eigen::RowVector2d(1, 0);
    basis.Lambda = (Eigen::Matrix2d() << 0, 1, -random.uniform(0, k), 0).finished();
    basis.blocks.push_back({0, 2, false});
    const auto coefficient = trial % 3;
    (coefficient == 0   ? system.mass_error
     : coefficient == 1 ? system.damping_error
                        : system.stiffness_error) = MatrixXd::Constant(1, 1, error);
    (coefficient == 0 ? off.mass : coefficient == 1 ? off.damping : off.stiffness)(0, 0) = -error;
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, false, true, basis, residual);
    // That of the damping is attained in R, but not in the Gram matrix as well.
    EXPECT_GT(expect_bounded(system, off, basis, residual).F, coefficient == 1 ? 0.9 : 1 - 1e-9);
  }
}

}  // namespace
}  // namespace dashpot::analysis
