// The residual of a basis and its bound, beside both with 33 digits: never less, and attained where
// errors of coefficients are; the separation of blocks; Newton's convergence.
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/block_sylvester.hpp>
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/spectrum/refinement.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/quad_matrix.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <array>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::LongMatrix;
using testing::near;
using testing::Quad;
using testing::quad_matrix;
using testing::QuadMatrix;
using testing::Random;

System<> random_pencil(Random& random, int n, bool symmetric) {
  System<> system = testing::system_from(random.spd(n), random.spd(n), 40 * random.spd(n));
  const MatrixXd skew = random.matrix(n, n);
  if (!symmetric) system.stiffness += skew - skew.transpose();
  return system;
}

/// A difference from given coefficients: none.
System<> none(int n) {
  System<> off(n);
  off.mass.setZero();
  return off;
}

/// A basis of single columns.
ModalBasis<> single_columns(const MatrixXd& U, const Eigen::VectorXd& rates) {
  ModalBasis<> basis;
  basis.U = U;
  basis.Lambda = rates.asDiagonal();
  for (int i = 0; i < U.cols(); ++i) basis.blocks.push_back({i, 1, false});
  return basis;
}

/// Evaluates the residual and expects it within its bounds: F* - F within F_error, with F* = -G^-1
/// Y' R, and weight G - I within E. Returns the largest share of F_error that is taken; 0 if there
/// is no bound. `off`: what the true coefficients differ by from the given ones.
double expect_bounded(const System<>& system, const System<>& off, bool symmetric, bool extended,
                      ModalBasis<>& basis, BasisResidual<>& residual) {
  evaluate_residual<kDynamic>(system, symmetric, extended, basis, residual);
  const QuadMatrix M = quad_matrix(system.mass) + quad_matrix(off.mass);
  const QuadMatrix C = quad_matrix(system.damping) + quad_matrix(off.damping);
  const QuadMatrix K = quad_matrix(system.stiffness) + quad_matrix(off.stiffness);
  const QuadMatrix Lambda = quad_matrix(basis.Lambda), U = quad_matrix(basis.U), V = U * Lambda;
  const QuadMatrix Y = quad_matrix(basis.Y.transpose()), YG = quad_matrix(residual.YG.transpose());
  QuadMatrix G = Y * (C * U + M * V) + YG * (M * U), F = Y * (K * U + C * V + M * (V * Lambda));
  const QuadMatrix wG = quad_matrix(basis.weight) * G;
  testing::solve(G, F);
  double share = 0;
  const auto taken = [](Quad error, double bound) {
    const Quad size = testing::magnitude(error);
    EXPECT_TRUE(size <= static_cast<Quad>(bound)) << static_cast<double>(size) << " > " << bound;
    return bound > 0 && bound < kInfinity ? static_cast<double>(size / static_cast<Quad>(bound))
                                          : 0;
  };
  for (int i = 0; i < basis.U.cols(); ++i) {
    for (int j = 0; j < basis.U.cols(); ++j) {
      share = std::max(share, taken(-F[at(i)][at(j)] - static_cast<Quad>(residual.F(i, j)),
                                    residual.F_error(i, j)));
      // E is within its own rounding errors, which F_error has slack for.
      taken(wG[at(i)][at(j)] - (i == j ? 1 : 0), residual.E(i, j) * (1 + 1e-14));
    }
  }
  return share;
}
double expect_bounded(const System<>& system, bool extended, ModalBasis<>& basis) {
  BasisResidual<> residual;
  return expect_bounded(system, none(static_cast<int>(system.dof())), false, extended, basis,
                        residual);
}

TEST(BasisResidual, OfTheSolversBasisIsWithinItsErrorOfTheTrueOne) {
  Random random(901);
  std::array<double, 2> largest{};
  for (int trial = 0; trial < 60; ++trial) {
    const bool symmetric = trial % 2 == 0, extended = trial % 3 == 0;
    const System<> system = random_pencil(random, random.integer(1, 6), symmetric);
    ModalBasis<> basis = analyze(system).basis;
    const double perturbation = trial % 5 == 0 ? 0 : random.log_uniform(1e-14, 1e-3);
    basis.U += perturbation * random.matrix(basis.U.rows(), basis.U.cols());
    BasisResidual<> residual;
    const double share = expect_bounded(system, none(static_cast<int>(system.dof())), symmetric,
                                        extended, basis, residual);
    largest[extended ? 1 : 0] = std::max(largest[extended ? 1 : 0], share);
    ASSERT_TRUE(residual.F_error.allFinite());
    // Not so wide as to be of no use.
    if (perturbation < 1e-10) EXPECT_LE(residual.F_error.norm(), 1e-8 * basis.Lambda.norm());
  }
  for (const double share : largest) EXPECT_GT(share, 0.003);
}

TEST(BasisResidual, OfAnyBasisIsCounted) {
  // Every other time [K C] is made for the basis: the residual is no more than rounding errors.
  Random random(5201);
  double largest = 0;
  for (int trial = 0; trial < 900; ++trial) {
    const bool wide = trial % 180 == 4;  // one block, whose sums are long
    const int n = wide ? 8 : random.integer(1, 3);
    ModalBasis<> basis;
    basis.U = random.matrix(n, 2 * n);
    basis.Lambda = MatrixXd::Zero(2 * n, 2 * n);
    for (int first = 0; first < 2 * n;) {
      const int size = wide ? 2 * n : std::min(random.integer(1, 3), 2 * n - first);
      basis.blocks.push_back({first, size, false});
      basis.Lambda.block(first, first, size, size) = random.matrix(size, size);
      first += size;
    }
    System<> system = testing::system_from(random.spd(n), random.matrix(n, n), random.matrix(n, n));
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
    largest = std::max(largest, expect_bounded(system, trial % 2 == 0, basis));
  }
  EXPECT_GT(largest, 0.05);
}

TEST(BasisResidual, OfColumnsThatAreNeitherEigenvectorsNorOrthogonalIsCounted) {
  Random random(2409);
  std::array<double, 2> largest{};
  for (int trial = 0; trial < 1000; ++trial) {
    const bool extended = trial % 4 == 0;
    const int n = random.integer(1, 2);
    System<> system(n);
    MatrixXd U = MatrixXd::Zero(n, 2 * n);
    Eigen::VectorXd rates(2 * n);
    for (int i = 0; i < n; ++i) {
      const double c = system.damping(i, i) = random.uniform(3, 5);
      const double k = system.stiffness(i, i) = random.uniform(0.5, 2);
      const double root = std::sqrt(c * c / 4 - k);
      rates.segment(2 * i, 2) << -c / 2 - root, -c / 2 + root;
      U(i, 2 * i) = U(i, 2 * i + 1) = 1;
    }
    const double away = extended ? random.log_uniform(3e-3, 3e-2) : random.log_uniform(1e-12, 3e-2);
    ModalBasis<> basis =
        single_columns(U + away * random.matrix(n, 2 * n), rates + away * random.vector(2 * n));
    BasisResidual<> residual;
    double& worst = largest[extended ? 1 : 0];
    worst = std::max(worst, expect_bounded(system, none(n), true, extended, basis, residual));
  }
  for (const double share : largest) EXPECT_GT(share, 0.01);
}

TEST(BasisResidual, OfForcesOfDampersThatCancelIsCounted) {
  // Two slow motions in a direction in which only the rounding errors of C are left.
  Random random(5205);
  int proved = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix2d directions = random.matrix(2, 2);
    const Eigen::Vector4d rates(-0x1p-30, -0x1p-29, -2, -0x1p-60);
    const Eigen::Vector2d c(-rates[0] - rates[1], -rates[2] - rates[3]);
    const Eigen::Vector2d k(rates[0] * rates[1], rates[2] * rates[3]);
    const System<> system = testing::system_from(
        MatrixXd::Identity(2, 2), directions * c.asDiagonal() * directions.inverse(),
        directions * k.asDiagonal() * directions.inverse());
    ModalBasis<> basis = single_columns(directions(Eigen::all, {0, 0, 1, 1}), rates);
    proved += expect_bounded(system, false, basis) > 0;
  }
  EXPECT_GT(proved, 100);
}

TEST(BasisResidual, OfSumsThatCancelToTheLastDigitIsCounted) {
  // One joint with c = -(l1 + l2), k = l1 l2 in two words each: R and the off-diagonal Gram matrix
  // contain only the rounding errors of the double-double arithmetic.
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
    // Y Lambda is rounded to doubles, and is what stands in the Gram matrix: of a 1 it is exact.
    ModalBasis<> basis =
        single_columns(Eigen::RowVector2d(1, random.uniform(1, 2)), Eigen::Vector2d(first, second));
    BasisResidual<> residual;
    expect_bounded(system, low, true, true, basis, residual);
    EXPECT_LE(residual.F_error.maxCoeff(), 1e-27);
  }
}

TEST(BasisResidual, OfForcesNearlyOrthogonalToALeftVectorIsCounted) {
  // R = K U - 2 U here, nearly orthogonal to the left vector of a short column: the products with
  // it are rounding errors of R and of their own, far larger than the rest of the column of F.
  Random random(5203);
  for (int trial = 0; trial < 200; ++trial) {
    const double p = random.uniform(0, 1), q = random.uniform(0, 1);
    const System<> system =
        testing::system_from(MatrixXd::Identity(2, 2), 3 * MatrixXd::Identity(2, 2),
                             (Eigen::Matrix2d() << 2 + p, q, -p, 2 - q).finished());
    MatrixXd U(2, 4);
    U << 0x1p-10, 1, 1, 1, 0x1p-10, -1, 1, -1;
    ModalBasis<> basis = single_columns(U, Eigen::Vector4d(-1, -1, -2, -2));
    BasisResidual<> residual;
    expect_bounded(system, none(2), false, true, basis, residual);
    ASSERT_TRUE(residual.F_error.allFinite());
  }
}

TEST(BasisResidual, AttainsErrorsOfCoefficients) {
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
    // The bound for the damping is attained in R, but not in the Gram matrix as well.
    EXPECT_GT(expect_bounded(system, off, false, true, basis, residual),
              coefficient == 1 ? 0.9 : 1 - 1e-9);
  }
  // One oscillator, in a basis that is 3 % off: what the errors do to R is attained, and they
  // change G and with it F by a thousandth of that.
  System<> system = testing::one_joint(1, 4, 1), off = none(1);
  const double error = 1e-3, root = std::sqrt(3.0);
  system.mass_error = system.damping_error = system.stiffness_error =
      MatrixXd::Constant(1, 1, error);
  double largest = 0;
  for (int signs = 0; signs < 32; ++signs) {
    const auto sign = [signs](int bit) { return (signs >> bit & 1) != 0 ? 1.0 : -1.0; };
    ModalBasis<> basis = single_columns(
        MatrixXd::Ones(1, 2),
        Eigen::Vector2d(-2 - root * (1 + 0.03 * sign(3)), -2 + root * (1 + 0.03 * sign(4))));
    off.mass(0, 0) = sign(0) * error;
    off.damping(0, 0) = sign(1) * error;
    off.stiffness(0, 0) = sign(2) * error;
    BasisResidual<> residual;
    largest = std::max(largest, expect_bounded(system, off, false, true, basis, residual));
  }
  EXPECT_GT(largest, 0.8);
}

TEST(BasisResidual, OfADegenerateBasisIsUnbounded) {
  Random random(902);
  const System<> system = random_pencil(random, 3, true);
  ModalBasis<> basis = analyze(system).basis;
  basis.U.col(2) = basis.U.col(0);
  basis.Lambda.col(2).setZero();
  basis.Lambda.row(2).setZero();
  basis.Lambda(2, 2) = basis.Lambda(0, 0);
  BasisResidual<> residual;
  evaluate_residual<kDynamic>(system, true, false, basis, residual);
  EXPECT_FALSE((residual.F_error.array() < 1).all());
}

// ------------------------------------------------------------------------------------ separations

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
  std::array<double, 5> closest{};
  for (int trial = 0; trial < 3200; ++trial) {
    const int k = 1 + trial % 4, l = 1 + trial / 4 % 4, kind = trial / 16 % 4;
    SCOPED_TRACE(std::to_string(k) + " x " + std::to_string(l));
    const State<kDynamic> A = random.matrix(k, k);
    State<kDynamic> B = random.matrix(l, l);
    if (kind == 0 && k == l) {  // all but common eigenvalues
      B = A + random.log_uniform(1e-12, 1e-1) * random.matrix(k, k);
    } else if (kind == 1 && k == l) {  // common ones, to rounding: Q' A Q
      const double t = random.uniform(0, 3);
      MatrixXd Q = MatrixXd::Identity(k, k);
      if (k > 1) Q.topLeftCorner(2, 2) << std::cos(t), std::sin(t), -std::sin(t), std::cos(t);
      B = Q.transpose() * A * Q;
    } else if (kind == 1 && l == 1) {  // one in common, to rounding
      for (const Complex& value : A.eigenvalues()) {
        if (value.imag() == 0) B(0, 0) = value.real();
      }
    }
    const State<kDynamic> C = random.matrix(k, l);
    State<kDynamic> X, Lambda = State<kDynamic>::Zero(k + l, k + l);
    Lambda.topLeftCorner(k, k) = A;
    Lambda.bottomRightCorner(l, l) = B;
    const double separation = solve_sylvester<kDynamic>(A, B, C, X);
    const double alone = block_separation<kDynamic>(Lambda, {0, k, false}, {k, l, false});
    const double truth = true_separation(A, B);
    EXPECT_LE(alone, truth * (1 + 1e-10) + 1e-18);
    EXPECT_LE(separation, truth * (1 + 1e-10) + 1e-18);
    if (truth < 1e-3) continue;
    EXPECT_GT(separation, 1e-3 * truth);
    EXPECT_TRUE(near(A * X - X * B, C, 1e-11 * (1 + X.norm() / truth)));
    double& best = closest[at(std::max(k, l))];
    best = std::max(best, alone / truth);
  }
  EXPECT_GT(closest[1], 0.999);
  for (const int size : {2, 3, 4}) EXPECT_GT(closest[at(size)], 0.3) << size;
}

TEST(Sylvester, HasNoSolutionWhereEigenvaluesAreCommon) {
  Random random(904);
  for (int size = 1; size <= 2; ++size) {
    const State<kDynamic> A = random.matrix(size, size);
    State<kDynamic> X;
    EXPECT_EQ(solve_sylvester<kDynamic>(A, A, random.matrix(size, size), X), 0);
    EXPECT_TRUE(near(X, MatrixXd::Zero(size, size), 0));
  }
  // Triangular blocks with the same number on the diagonal, which no rounding error may part.
  for (int trial = 0; trial < 1000; ++trial) {
    const double common = random.uniform(-1, 1);
    const auto triangle = [&] {
      Block2<double> block{common, random.uniform(-1, 1), 0, random.uniform(-1, 1)};
      if (random.integer(0, 1) == 1) std::swap(block.b, block.c);
      if (random.integer(0, 1) == 1) std::swap(block.a, block.d);
      return MeasuredBlock<double>(block);
    };
    const MeasuredBlock<double> A = triangle(), B = triangle();
    EXPECT_FALSE(separation(A, B) > 0);
    EXPECT_FALSE(separation(common, B) > 0);
  }
}

TEST(NewtonStep, ConvergesQuadratically) {
  Random random(905);
  for (const bool symmetric : {true, false}) {
    const System<> system = random_pencil(random, 5, symmetric);
    ModalBasis<> basis = analyze(system).basis;
    basis.U += 1e-4 * basis.U.norm() * random.matrix(5, 10) / 10;
    BasisResidual<> residual;
    BlockEnclosure<> enclosure;
    std::vector<double> sizes;  // largest block of F off the diagonal, over |Lambda|
    for (int step = 0; step < 4; ++step) {
      evaluate_residual<kDynamic>(system, symmetric, true, basis, residual);
      double& largest = sizes.emplace_back(0);
      for (const Block& a : basis.blocks) {
        for (const Block& b : basis.blocks) {
          if (a.first == b.first) continue;
          largest = std::max(largest, residual.F.block(a.first, b.first, a.size, b.size).norm() /
                                          basis.Lambda.norm());
        }
      }
      enclose<kDynamic>(residual, basis, enclosure);
      newton_step<kDynamic>(residual, basis);
    }
    EXPECT_GT(sizes[0], 1e-6);
    EXPECT_LE(sizes[1], std::min(1e3 * sizes[0], 1e-2) * sizes[0]) << sizes[0];
    EXPECT_LE(sizes[2], 1e3 * sizes[1] * sizes[1] + 1e-15) << sizes[1];
    EXPECT_LE(sizes[3], 1e-15);
  }
}

}  // namespace
}  // namespace dashpot::analysis
