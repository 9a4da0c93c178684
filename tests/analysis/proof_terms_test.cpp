// Each term of the proved radii of blocks, in a case that is not enclosed without it.
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/special_values.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::LongComplex;
using testing::LongMatrix;
using testing::Random;

// -------------------------------------------------------------------------- radii of the blocks

/// Lambda of single eigenvalues, and a perturbation of it: F as computed, and a bound of its error.
struct Perturbed {
  ModalBasis<> basis;
  BasisResidual<> residual;
  BlockEnclosure<> enclosure;

  explicit Perturbed(const VectorXd& Lambda) {
    const Eigen::Index states = Lambda.size();
    basis.U = MatrixXd::Ones(states / 2, states);
    basis.Lambda = Lambda.asDiagonal();
    basis.weight = MatrixXd::Identity(states, states);
    for (int i = 0; i < states; ++i) basis.blocks.push_back({i, 1, false});
    residual.F = residual.F_error = MatrixXd::Zero(states, states);
  }

  /// The matrix with this error, which has to be within F_error, is enclosed: each group has at
  /// least as many of its eigenvalues within the radius as it has blocks.
  void expect_enclosed(const MatrixXd& error) {
    ASSERT_TRUE((error.array().abs() <= residual.F_error.array()).all());
    const LongMatrix exact = basis.Lambda.cast<long double>() + residual.F.cast<long double>() +
                             error.cast<long double>();
    const auto eigenvalues = Eigen::EigenSolver<LongMatrix>(exact, false).eigenvalues().eval();
    enclose<kDynamic>(residual, basis, enclosure);
    const auto states = static_cast<int>(basis.Lambda.rows());
    for (int group = 0; group < states; ++group) {
      int members = 0, inside = 0;
      for (int i = 0; i < states; ++i) members += enclosure.group[i] == group ? 1 : 0;
      for (const LongComplex& z : eigenvalues) {
        long double away = std::numeric_limits<long double>::infinity();
        for (int i = 0; i < states; ++i) {
          if (enclosure.group[i] != group) continue;
          away = std::min(away, std::abs(z - static_cast<long double>(basis.Lambda(i, i))));
        }
        if (away <= static_cast<long double>(enclosure.radius[group]) + 1e-18L) ++inside;
      }
      EXPECT_GE(inside, members) << "group " << group << ", radius " << enclosure.radius[group];
    }
  }
};

TEST(ProofTerms, ErrorsOfABlockItself) {
  Perturbed one(VectorXd{{-1, -3}});
  one.residual.F_error.diagonal() << 0.25, 0.125;
  one.expect_enclosed(Eigen::Vector2d(0.25, -0.125).asDiagonal());
  EXPECT_LE(one.enclosure.radius[0], 0.2500001);
}

TEST(ProofTerms, ErrorsOfAWideBlockCountInTheFrobeniusNorm) {
  Random random(2401);
  for (int trial = 0; trial < 100; ++trial) {
    ModalBasis<> basis;
    basis.U = MatrixXd::Ones(1, 2);
    basis.Lambda = random.matrix(2, 2);
    basis.weight = MatrixXd::Identity(2, 2);
    basis.blocks.push_back({0, 2, trial % 2 == 0});
    BasisResidual<> residual;
    residual.F = 1e-3 * random.matrix(2, 2);
    residual.F_error = 1e-3 * random.matrix(2, 2).cwiseAbs();
    // The F of a zero mode, whose form is kept, is an error too.
    const LongMatrix F = residual.F.cast<long double>(),
                     error = residual.F_error.cast<long double>();
    const LongMatrix lost = trial % 2 == 0 ? LongMatrix(F.cwiseAbs() + error) : error;
    BlockEnclosure<> enclosure;
    enclose<kDynamic>(residual, basis, enclosure);
    EXPECT_GE(static_cast<long double>(enclosure.radius[0]), lost.norm());
    EXPECT_LE(static_cast<long double>(enclosure.radius[0]), lost.norm() * (1 + 1e-9L));
  }
}

TEST(ProofTerms, RoundingOfTheBlocksThatAreUpdated) {
  Random random(2402);
  for (int trial = 0; trial < 100; ++trial) {
    Perturbed one(VectorXd{{random.uniform(1, 2), -3}});
    one.residual.F(0, 0) = random.uniform(-1, 1) * 1e-3;
    one.expect_enclosed(MatrixXd::Zero(2, 2));
  }
}

TEST(ProofTerms, MovesOfBothBlocks) {
  // The blocks move from 1 apart to 0.1 apart, where a coupling of 0.03 counts ten times as much.
  Perturbed pair(VectorXd{{0, 1}});
  pair.residual.F << 0.45, 0.03, -0.03, -0.45;
  pair.expect_enclosed(MatrixXd::Zero(2, 2));
  // One of them moves, either one.
  for (const bool first : {true, false}) {
    Perturbed one(VectorXd{{0, 1}});
    one.residual.F << (first ? 0.9 : 0), 0.03, -0.03, (first ? 0 : -0.9);
    one.expect_enclosed(MatrixXd::Zero(2, 2));
  }
}

TEST(ProofTerms, ErrorsOfBothBlocks) {
  // The same by errors of the blocks, of which both E11 and E22 have to be taken off.
  Perturbed pair(VectorXd{{0, 1}});
  pair.residual.F_error.diagonal() << 0.45, 0.45;
  pair.residual.F << 0, 0.02, -0.02, 0;
  pair.expect_enclosed(Eigen::Vector2d(0.45, -0.45).asDiagonal());
  EXPECT_NE(pair.enclosure.group[0], pair.enclosure.group[1]);
}

TEST(ProofTerms, RadiiAreThoseOfTheTheorem) {
  // r = |E11| + 2 |E12| |E21| / delta, delta = sep - |E11| - |E22|, with all of E for E22.
  Random random(2403);
  for (int trial = 0; trial < 200; ++trial) {
    const int states = 2 * random.integer(1, 3);
    VectorXd Lambda(states);
    for (int i = 0; i < states; ++i) Lambda[i] = 10 * i + random.uniform(0, 2);
    Perturbed all(Lambda);
    all.residual.F_error = 0.2 * random.matrix(states, states).cwiseAbs();
    const LongMatrix E = all.residual.F_error.cast<long double>();
    const long double own = E.diagonal().maxCoeff();
    const long double everything = own + std::sqrt(E.squaredNorm() - E.diagonal().squaredNorm());
    all.expect_enclosed(all.residual.F_error);
    for (int i = 0; i < states; ++i) {
      const long double inner = E(i, i);
      const long double right = std::sqrt(E.row(i).squaredNorm() - inner * inner);
      const long double left = std::sqrt(E.col(i).squaredNorm() - inner * inner);
      long double separation = std::numeric_limits<long double>::infinity();
      for (int j = 0; j < states; ++j) {
        if (j == i) continue;
        separation =
            std::min(separation, static_cast<long double>(std::abs(Lambda[i] - Lambda[j])));
      }
      const long double exact = inner + 2 * right * left / (separation - inner - everything);
      EXPECT_NEAR(all.enclosure.radius[i] / static_cast<double>(exact), 1 + 1e-9, 1e-9)
          << "block " << i;
    }
  }
}

TEST(ProofTerms, BlocksThatNearlyMeetShareAGroup) {
  // 4 |E12| |E21| < delta^2, delta = 1 - sqrt(E12^2 + E21^2) for two blocks 1 apart: e < 0.2929.
  for (const double coupling : {0.29, 0.296}) {
    Perturbed pair(VectorXd{{0, 1}});
    pair.residual.F << 0, coupling, -coupling, 0;
    pair.expect_enclosed(MatrixXd::Zero(2, 2));
    EXPECT_EQ(pair.enclosure.group[0] == pair.enclosure.group[1], coupling > 0.2929);
  }
}

TEST(ProofTerms, CouplingWithinAGroup) {
  Perturbed pair(VectorXd{{1, 1}});
  pair.residual.F << 0, 0.1, 0.1, 0;
  pair.expect_enclosed(MatrixXd::Zero(2, 2));
  EXPECT_LE(pair.enclosure.radius[0], 0.15);
}

TEST(ProofTerms, AreSafeFromTheirOwnRoundingErrors) {
  // delta is a small difference, of which rounding takes 1e-7, because the two other blocks are
  // coupled by almost as much as the gap is wide.
  Random random(2404);
  int alone = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const double gap = random.uniform(1, 3), delta = random.log_uniform(2e-9, 1e-8) * gap;
    Perturbed all(VectorXd{{0, gap, 100, 1000}});
    all.residual.F(1, 2) = gap - delta;
    const double coupling = 0.01 * delta * delta;
    all.residual.F(0, 1) = all.residual.F(1, 0) = coupling;
    enclose<kDynamic>(all.residual, all.basis, all.enclosure);
    if ((all.enclosure.group.array() == all.enclosure.group[0]).count() > 1) continue;
    ++alone;
    const long double e = static_cast<long double>(coupling),
                      large = static_cast<long double>(all.residual.F(1, 2));
    const long double exact_delta =
        static_cast<long double>(gap) - std::sqrt(large * large + 2 * e * e);
    EXPECT_GE(static_cast<long double>(all.enclosure.radius[0]), 2 * e * e / exact_delta)
        << "trial " << trial;
  }
  EXPECT_GT(alone, 200);
}

// ------------------------------------------------------------------------------------ separations

/// The smallest singular value of X -> A X - X B.
long double separation_of(const MatrixXd& A, const MatrixXd& B) {
  const Eigen::Index k = A.rows(), l = B.rows();
  LongMatrix map = LongMatrix::Zero(k * l, k * l);
  for (Eigen::Index j = 0; j < l; ++j) {
    map.block(j * k, j * k, k, k) += A.cast<long double>();
    for (Eigen::Index i = 0; i < l; ++i) {
      map.block(j * k, i * k, k, k).diagonal().array() -= static_cast<long double>(B(i, j));
    }
  }
  return Eigen::JacobiSVD<LongMatrix>(map).singularValues()[k * l - 1];
}

TEST(ProofTerms, SeparationsAreLowerBounds) {
  Random random(2404);
  std::array<double, 4> closest{};
  for (int trial = 0; trial < 3000; ++trial) {
    const int a = random.integer(1, 3), b = random.integer(1, 3);
    State<kDynamic> Lambda = MatrixXd::Zero(a + b, a + b);
    Lambda.topLeftCorner(a, a) = random.matrix(a, a);
    Lambda.bottomRightCorner(b, b) = random.matrix(b, b);
    const bool alike = trial % 2 == 0 && a == b;
    if (alike) {  // eigenvalues in common, to rounding: Q' A Q
      const double t = random.uniform(0, 3);
      MatrixXd Q = MatrixXd::Identity(a, a);
      if (a > 1) Q.topLeftCorner(2, 2) << std::cos(t), std::sin(t), -std::sin(t), std::cos(t);
      Lambda.bottomRightCorner(b, b) = Q.transpose() * Lambda.topLeftCorner(a, a) * Q;
    }
    const bool in_common = trial % 2 == 0 && a == 3 && b == 1;
    if (in_common) {
      for (const Complex& value : Lambda.topLeftCorner(3, 3).eigenvalues()) {
        if (value.imag() == 0) Lambda(3, 3) = value.real();
      }
    }
    const double bound = block_separation<kDynamic>(Lambda, {0, a, false}, {a, b, false});
    const auto truth = static_cast<double>(
        separation_of(Lambda.topLeftCorner(a, a), Lambda.bottomRightCorner(b, b)));
    EXPECT_LE(bound, truth * (1 + 1e-10) + 1e-18) << a << " and " << b << (alike ? ", alike" : "");
    if (!alike && !in_common) {
      double& best = closest[static_cast<std::size_t>(std::max(a, b))];
      best = std::max(best, bound / truth);
    }
  }
  EXPECT_GT(closest[1], 0.999);
  EXPECT_GT(closest[2], 0.3);
  EXPECT_GT(closest[3], 0.3);
}

// ------------------------------------------------------------------------- the residual of a basis

/// F* = -G^-1 Y' R of a basis, and the largest share of F_error that F* - F takes.
double residual_share(const System<>& system, const ModalBasis<>& basis,
                      const BasisResidual<>& residual) {
  const auto wide = [](const MatrixXd& A) { return LongMatrix(A.cast<long double>()); };
  const LongMatrix M = wide(system.mass), C = wide(system.damping), K = wide(system.stiffness);
  const LongMatrix U = wide(basis.U), Lambda = wide(basis.Lambda), Y = wide(basis.Y);
  const LongMatrix V = U * Lambda;
  const LongMatrix R = K * U + C * V + M * V * Lambda;
  const LongMatrix G =
      Y.transpose() * (C * U + M * V) + (Y * wide(basis.Gamma)).transpose() * (M * U);
  const LongMatrix F = -(G.fullPivLu().solve(Y.transpose() * R));
  const LongMatrix shares = (F - wide(residual.F)).cwiseAbs().cwiseQuotient(wide(residual.F_error));
  return static_cast<double>(shares.maxCoeff());
}

TEST(ProofTerms, ErrorsOfCoefficientsCountInTheGramMatrixToo) {
  // One oscillator, in a basis that is 3 % off: what the errors do to R is attained, and they
  // change G and with it F by a thousandth of that.
  System<> system(1);
  system.damping(0, 0) = 4;
  system.stiffness(0, 0) = 1;
  const double error = 1e-3;
  system.mass_error = system.damping_error = system.stiffness_error =
      MatrixXd::Constant(1, 1, error);
  double largest = 0;
  for (int signs = 0; signs < 32; ++signs) {
    const auto sign = [signs](int bit) { return (signs >> bit & 1) != 0 ? 1.0 : -1.0; };
    ModalBasis<> basis;
    basis.U = MatrixXd::Ones(1, 2);
    basis.Lambda = Eigen::Vector2d(-2 - std::sqrt(3.0) * (1 + 0.03 * sign(3)),
                                   -2 + std::sqrt(3.0) * (1 + 0.03 * sign(4)))
                       .asDiagonal();
    for (int i = 0; i < 2; ++i) basis.blocks.push_back({i, 1, false});
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, false, true, basis, residual);
    ASSERT_TRUE(residual.F_error.allFinite());
    System<> truth = system;
    truth.mass(0, 0) += sign(0) * error;
    truth.damping(0, 0) += sign(1) * error;
    truth.stiffness(0, 0) += sign(2) * error;
    const double share = residual_share(truth, basis, residual);
    EXPECT_LE(share, 1) << "signs " << signs;
    largest = std::max(largest, share);
  }
  EXPECT_GT(largest, 0.8);
}

TEST(ProofTerms, ResidualsOfABasisAreWithinTheirErrors) {
  // Two oscillators in a basis of single columns that are neither eigenvectors nor orthogonal.
  Random random(2409);
  std::array<double, 2> largest{};
  for (int trial = 0; trial < 2000; ++trial) {
    const bool extended = trial % 4 == 0;
    const int n = random.integer(1, 2);
    System<> system(n);
    for (int i = 0; i < n; ++i) {
      system.damping(i, i) = random.uniform(3, 5);
      system.stiffness(i, i) = random.uniform(0.5, 2);
    }
    ModalBasis<> basis;
    basis.U = MatrixXd::Zero(n, 2 * n);
    basis.Lambda = MatrixXd::Zero(2 * n, 2 * n);
    for (int i = 0; i < n; ++i) {
      const double half = system.damping(i, i) / 2;
      const double root = std::sqrt(half * half - system.stiffness(i, i));
      basis.Lambda(2 * i, 2 * i) = -half - root;
      basis.Lambda(2 * i + 1, 2 * i + 1) = -half + root;
      basis.U(i, 2 * i) = basis.U(i, 2 * i + 1) = 1;
    }
    for (int i = 0; i < 2 * n; ++i) basis.blocks.push_back({i, 1, false});
    const double away = extended ? random.log_uniform(3e-3, 3e-2) : random.log_uniform(1e-12, 3e-2);
    basis.U += away * random.matrix(n, 2 * n);
    basis.Lambda.diagonal() += away * random.vector(2 * n);
    BasisResidual<> residual;
    evaluate_residual<kDynamic>(system, true, extended, basis, residual);
    if (!residual.F_error.allFinite()) continue;
    const double share = residual_share(system, basis, residual);
    EXPECT_LE(share, 1) << "trial " << trial << ", away " << away;
    double& worst = largest[extended ? 1 : 0];
    worst = std::max(worst, share);
  }
  for (const double share : largest) EXPECT_GT(share, 0.01);
}

}  // namespace
}  // namespace dashpot::analysis
