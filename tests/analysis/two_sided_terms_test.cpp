// Parts of two-sided bases by themselves: the bounds of rounding errors against the formulas of
// their documentation, written out in loops; balanced columns; rotated blocks.
#include <dashpot/analysis/tracker/two_sided_basis.hpp>
#include <dashpot/analysis/tracker/two_sided_errors.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;

/// Any basis of a random system: p modes, with a stiffness factor if p < n.
struct AnyBasis {
  System<kMaxDof> system;
  BlockEigenbasis basis;

  AnyBasis(Random& random, int n, int p) : system(n) {
    system.mass = random.spd(n);
    system.damping = random.matrix(n, n);
    if (p < n) {
      system.stiffness_factor = random.matrix(p, n);
    } else {
      system.stiffness = random.matrix(n, n);
    }
    basis.two_sided = true;
    basis.modes = p;
    basis.zeros = n - p;
    basis.Z.width = basis.Y.width = packed_width(p, n - p);
    for (int i = 0; i < n + p; ++i) {
      for (int j = 0; j < n + p; ++j) {
        basis.Z(i, j) = random.uniform(-2, 2);
        basis.Y(i, j) = random.uniform(-2, 2);
      }
    }
    for (auto* entries : {&basis.l00, &basis.l01, &basis.l10, &basis.l11}) {
      for (int i = 0; i < p; ++i) (*entries)[static_cast<std::size_t>(i)] = random.uniform(-9, 9);
    }
    for (int k = 0; k < n - p; ++k) {
      basis.rate[static_cast<std::size_t>(k)] = random.uniform(-3, 3);
    }
  }
  SymmetricPencil pencil() const { return symmetric_pencil(system); }

  /// Entries of Z or Y.
  static MatrixXd dense(const PackedMatrix& X, int size) {
    MatrixXd result(size, size);
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) result(i, j) = X(i, j);
    }
    return result;
  }
  double rate(int block) const {
    if (block >= basis.modes)
      return std::abs(basis.rate[static_cast<std::size_t>(block - basis.modes)]);
    return std::sqrt(basis.block(block).squared_norm());
  }
  /// Of what belongs to each column the length for each block.
  VectorXd joined(const VectorXd& x) const {
    VectorXd result(basis.blocks());
    for (int i = 0; i < basis.blocks(); ++i) {
      result[i] =
          i < basis.modes ? std::hypot(x[basis.first(i)], x[basis.second(i)]) : x[basis.first(i)];
    }
    return result;
  }
};

TEST(TwoSidedErrors, AreThoseOfTheFormulas) {
  Random random(8107);
  for (const auto& [n, p] : {std::pair(1, 1),
                             {2, 2},
                             {6, 6},
                             {7, 7},
                             {16, 16},
                             {3, 2},
                             {7, 6},
                             {7, 5},
                             {9, 4},
                             {16, 13}}) {
    SCOPED_TRACE(std::to_string(n) + " joints, rank " + std::to_string(p));
    const AnyBasis any(random, n, p);
    const TwoSidedErrors errors(any.pencil(), any.basis);
    EXPECT_TRUE(errors.in_range());

    const MatrixXd Z = AnyBasis::dense(any.basis.Z, n + p).cwiseAbs();
    const MatrixXd Y = AnyBasis::dense(any.basis.Y, n + p).cwiseAbs();
    const VectorXd s = MatrixXd(any.system.mass).diagonal().cwiseSqrt();
    const auto norm = [&](const MatrixXd& A) {
      return (s.cwiseInverse().asDiagonal() * A.cwiseAbs() * s.cwiseInverse().asDiagonal())
          .eval()
          .maxCoeff();
    };
    const double mass = norm(any.system.mass), damping = norm(any.system.damping);
    const MatrixXd left_positions = Y.leftCols(p), left_velocities = Y.rightCols(n);
    const MatrixXd positions = Z.topRows(p), velocities = Z.bottomRows(n);
    VectorXd a, b, z, x, f;
    const VectorXd p_rows = left_velocities * s, e = velocities.transpose() * s;
    if (p < n) {
      const VectorXd t = MatrixXd(any.system.stiffness_factor).cwiseAbs().colwise().sum();
      a = left_positions.rowwise().maxCoeff();
      b = left_velocities * t;
      z = positions.colwise().sum();
      x = velocities.transpose() * t;
      f = z;
    } else {
      a = (left_positions * s.cwiseInverse().asDiagonal()).rowwise().maxCoeff();
      b = p_rows;
      z = positions.transpose() * s;
      x = e;
      f = norm(any.system.stiffness) * z;
    }
    const int blocks = any.basis.blocks();
    const VectorXd A = any.joined(a), B = any.joined(b), P = any.joined(p_rows);
    const VectorXd z_of = any.joined(z), e_of = any.joined(e), F = any.joined(f);
    VectorXd X = any.joined(x), momenta(blocks);
    for (int j = 0; j < blocks; ++j) {
      X[j] += z_of[j] * any.rate(j);
      momenta[j] = (damping + mass * any.rate(j)) * e_of[j];
    }
    const double gamma = (2 * (n + p) + 16) * 0x1p-53;
    const auto near = [](double value, double expected) {
      EXPECT_NEAR(value, expected, 1e-9 * expected);
    };
    for (int j = 0; j < blocks; ++j) {
      const Vec4d columns = errors.of_columns(j / 4 * 4);
      near(columns[j % 4], gamma * (A.norm() * X[j] + B.norm() * F[j] + P.norm() * momenta[j]));
      near(errors.of_N(j), gamma * (A[j] * z_of.norm() + P[j] * mass * e_of.norm()));
      for (int i = 0; i < blocks; ++i) {
        near(errors.of_G(i, j / 4 * 4)[j % 4],
             gamma * (A[i] * X[j] + B[i] * F[j] + P[i] * momenta[j]));
      }
    }
    near(errors.of_G(),
         gamma * (A.norm() * X.norm() + B.norm() * F.norm() + P.norm() * momenta.norm()));
    near(errors.of_N(), gamma * (A.norm() * z_of.norm() + P.norm() * mass * e_of.norm()));
  }
}

/// N = Y S Z and G = Y B Z - N Lambda with the states and matrices of the documentation.
TEST(TwoSidedResidual, IsThatOfItsDefinition) {
  Random random(8110);
  for (const auto& [n, p] : {std::pair(1, 1), {6, 6}, {16, 16}, {3, 2}, {7, 5}, {16, 13}}) {
    SCOPED_TRACE(std::to_string(n) + " joints, rank " + std::to_string(p));
    AnyBasis any(random, n, p);
    TrackedResidual residual;
    for (PackedMatrix* X : {&residual.MV, &residual.image, &residual.R, &residual.G}) {
      X->items.fill(7);  // of another update
    }
    evaluate(any.pencil(), any.basis, residual);

    MatrixXd S = MatrixXd::Identity(n + p, n + p), B = MatrixXd::Zero(n + p, n + p);
    S.bottomRightCorner(n, n) = -any.system.mass;
    B.bottomRightCorner(n, n) = any.system.damping;
    if (p < n) {
      B.topRightCorner(p, n) = any.system.stiffness_factor;
      B.bottomLeftCorner(n, p) = any.system.stiffness_factor.transpose();
    } else {
      B.topRightCorner(n, n).setIdentity();
      B.bottomLeftCorner(n, n) = any.system.stiffness;
    }
    const MatrixXd Z = AnyBasis::dense(any.basis.Z, n + p), Y = AnyBasis::dense(any.basis.Y, n + p);
    const MatrixXd N = Y * S * Z, T = Y * B * Z;
    MatrixXd sigma = -MatrixXd::Identity(n + p, n + p), Lambda = MatrixXd::Zero(n + p, n + p);
    sigma.topLeftCorner(p, p) *= -1;
    MatrixXd off = MatrixXd::Ones(n + p, n + p);  // no block of a mode or rate
    for (int i = 0; i < any.basis.blocks(); ++i) {
      std::vector<int> at = {any.basis.first(i)};
      if (i < p) at.push_back(any.basis.second(i));
      Lambda(at, at) = MatrixXd(N(at, at)).inverse() * T(at, at);
      off(at, at).setZero();
      if (i >= p) {
        EXPECT_NEAR(any.basis.rate[static_cast<std::size_t>(i - p)], Lambda(at[0], at[0]),
                    1e-9 * std::abs(Lambda(at[0], at[0])));
        continue;
      }
      const Block2<double> block = any.basis.block(i);
      const Eigen::Matrix2d found{{block.a, block.b}, {block.c, block.d}};
      EXPECT_LT((found - Lambda(at, at)).norm(), 1e-9 * found.norm());
      EXPECT_LT(residual.diagonal[static_cast<std::size_t>(i)], 1e-20 * T.squaredNorm());
      for (const int row : at) {
        for (const int column : at) EXPECT_EQ(residual.G(row, column), 0);
      }
    }
    const MatrixXd G = (T - N * Lambda).cwiseProduct(off);
    const MatrixXd found = AnyBasis::dense(residual.G, n + p).cwiseProduct(off);
    EXPECT_LT((found - G).norm(), 1e-9 * (1 + G.norm()));
    EXPECT_LT((AnyBasis::dense(residual.R, n + p) - (N - sigma)).norm(), 1e-12 * (1 + N.norm()));
  }
}

/// Y S Z of a block's rows and columns.
Eigen::Matrix2d metric_of(const AnyBasis& any, int i) {
  const int n = any.pencil().joints, p = any.pencil().rank;
  MatrixXd S = MatrixXd::Identity(n + p, n + p);
  S.bottomRightCorner(n, n) = -any.system.mass;
  const MatrixXd Z = AnyBasis::dense(any.basis.Z, n + p), Y = AnyBasis::dense(any.basis.Y, n + p);
  const std::vector<int> at = {any.basis.first(i), any.basis.second(i)};
  return (Y * S * Z)(at, at);
}

TEST(BalancedBasis, IsOrthonormalInTheEnergyOfEachBlockAndKeepsItsMetric) {
  Random random(8108);
  for (const auto& [n, p] : {std::pair(6, 6), {16, 16}, {7, 5}, {16, 13}}) {
    SCOPED_TRACE(std::to_string(n) + " joints, rank " + std::to_string(p));
    AnyBasis any(random, n, p);
    // Frequencies from 1 rad/s on; the last one below the least rate that counts.
    double largest = 0;
    for (int i = 0; i < p; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double w = i + 1 < p ? 1 + 3 * i : 1e-5;
      any.basis.l00[k] = any.basis.l11[k] = 0;
      any.basis.l01[k] = -w;
      any.basis.l10[k] = w;
      largest = std::max(largest, w * w);
    }
    std::vector<Eigen::Matrix2d> before;
    for (int i = 0; i < p; ++i) before.push_back(metric_of(any, i));
    EXPECT_TRUE(balance(any.pencil(), true, any.basis));
    const VectorXd D = MatrixXd(any.system.mass).diagonal();
    for (int i = 0; i < p; ++i) {
      const double w2 = std::max(1e-6 * largest, any.basis.block(i).determinant());
      VectorXd energy(n + p);
      energy.head(p) = p < n ? VectorXd::Ones(p) : VectorXd(w2 * D);
      energy.tail(n) = D;
      const std::vector<int> at = {any.basis.first(i), any.basis.second(i)};
      const MatrixXd columns = AnyBasis::dense(any.basis.Z, n + p)(Eigen::all, at);
      const Eigen::Matrix2d gram = columns.transpose() * energy.asDiagonal() * columns;
      EXPECT_LT((gram - Eigen::Matrix2d::Identity()).norm(), 1e-12) << gram;
      // With the signs of Sigma rows and columns change by inverse matrices.
      const Eigen::Matrix2d after = metric_of(any, i);
      EXPECT_NEAR(after.determinant(), before[static_cast<std::size_t>(i)].determinant(),
                  1e-9 * std::max(1.0, std::abs(after.determinant())));
    }
    // What is even already stays.
    const BlockEigenbasis balanced = any.basis;
    EXPECT_FALSE(balance(any.pencil(), false, any.basis));
    EXPECT_EQ(any.basis.Z.items, balanced.Z.items);
    // A column four times as long as the other is not; one two and a half times as long is.
    for (const double factor : {2.5, 4.0}) {
      any.basis = balanced;
      for (int row = 0; row < n + p; ++row) any.basis.Z(row, 1) *= factor;
      EXPECT_EQ(balance(any.pencil(), false, any.basis), factor > 3) << factor;
    }
  }
}

TEST(RotatedBasis, IsOrthogonalInTheEnergyMetricToo) {
  Random random(8109);
  for (const auto& [n, p] : {std::pair(6, 6), {7, 5}}) {
    SCOPED_TRACE(std::to_string(n) + " joints, rank " + std::to_string(p));
    AnyBasis any(random, n, p);
    any.basis.two_sided = false;
    // Columns with z'Sz = 1 and -1, orthogonal in S: each made by hand of an elastic and a kinetic
    // vector of unit energy, x = cosh e + sinh k, y = sinh e + cosh k.
    const MatrixXd L = Eigen::LLT<MatrixXd>(MatrixXd(any.system.mass)).matrixL();
    MatrixXd Z = MatrixXd::Zero(n + p, n + p);
    for (int i = 0; i < p; ++i) {
      const double tilt = random.uniform(-0.8, 0.8);
      const VectorXd elastic = random.vector(p).normalized();
      const VectorXd kinetic = L.transpose().inverse() * random.vector(n).normalized();
      Z.col(i) << std::cosh(tilt) * elastic, std::sinh(tilt) * kinetic;
      Z.col(p + i) << std::sinh(tilt) * elastic, std::cosh(tilt) * kinetic;
    }
    TrackedResidual residual;
    residual.MV.width = any.basis.Z.width;
    const MatrixXd momenta = -any.system.mass * Z.bottomRows(n);
    for (int row = 0; row < n + p; ++row) {
      for (int j = 0; j < n + p; ++j) {
        any.basis.Z(row, j) = Z(row, j);
        residual.MV(row, j) = row < p ? Z(row, j) : momenta(row - p, j);
      }
    }
    EXPECT_TRUE(rotate_hyperbolically(residual, 1e-3, any.basis));
    const MatrixXd after = AnyBasis::dense(any.basis.Z, n + p);
    for (int i = 0; i < p; ++i) {
      const VectorXd x = after.col(i), y = after.col(p + i);
      const double elastic = x.head(p).dot(y.head(p));
      const double kinetic = x.tail(n).dot(any.system.mass * y.tail(n));
      EXPECT_NEAR(elastic + kinetic, 0, 1e-12);
      EXPECT_NEAR(elastic - kinetic, 0, 1e-12);  // still orthogonal in S
      EXPECT_NEAR(x.head(p).squaredNorm() - x.tail(n).dot(any.system.mass * x.tail(n)), 1, 1e-12);
    }
    // What is orthogonal to the tolerance is left alone.
    EXPECT_FALSE(rotate_hyperbolically(residual, 2, any.basis));
  }
}

}  // namespace
}  // namespace dashpot::analysis
