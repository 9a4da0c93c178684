// Bounds that are computed in double, against the same quantities in a wider arithmetic: a bound is
// never less, and would be if a term were left out or its rounding errors were not counted.
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/block_sylvester.hpp>
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::LongComplex;
using testing::LongMatrix;
using testing::Random;
using Long = long double;

// -------------------------------------------------------------------------- radii of the blocks

/// Norms of the blocks of F, and what is proved from them.
struct NormsOfF {
  MatrixXd coupling2, separation;
  VectorXd own;
  BlockEnclosure<> enclosure;

  explicit NormsOfF(int count)
      : coupling2(MatrixXd::Zero(count, count)),
        separation(MatrixXd::Ones(count, count)),
        own(VectorXd::Zero(count)) {}

  /// Stewart's condition and radius for the group of block i, evaluated in long double.
  void expect_proved(int i) const {
    const auto count = static_cast<int>(own.size());
    const auto member = [&](int j) { return enclosure.group[j] == enclosure.group[i]; };
    Long largest = 0, everything2 = 0, own_of_group = 0, inner2 = 0, right2 = 0, left2 = 0;
    Long apart = std::numeric_limits<Long>::infinity();
    for (int j = 0; j < count; ++j) {
      const auto of_block = static_cast<Long>(own[j]);
      largest = std::max(largest, of_block);
      if (member(j)) own_of_group = std::max(own_of_group, of_block);
      for (int k = 0; k < count; ++k) {
        const auto square = j == k ? 0 : static_cast<Long>(coupling2(j, k));
        everything2 += square;
        if (member(j) && member(k)) inner2 += square;
        if (member(j) && !member(k)) right2 += square;
        if (!member(j) && member(k)) left2 += square;
        if (member(j) && !member(k)) apart = std::min(apart, static_cast<Long>(separation(j, k)));
      }
    }
    Long exact = own_of_group + std::sqrt(inner2);
    if (std::isfinite(apart)) {
      const Long delta = apart - exact - largest - std::sqrt(everything2);
      const Long product = std::sqrt(right2 * left2);
      EXPECT_GT(delta, 0);
      EXPECT_LT(4 * product, delta * delta);
      exact += 2 * product / delta;
    }
    EXPECT_GE(static_cast<Long>(enclosure.radius[i]), exact) << "block " << i;
  }
  /// True if every block is a group by itself.
  bool prove_all() {
    const auto count = static_cast<int>(own.size());
    enclosure.reset(count);
    prove(PerturbationBounds<MatrixXd, VectorXd>{coupling2, separation, own}, enclosure);
    bool apart = true;
    for (int i = 0; i < count; ++i) {
      expect_proved(i);
      apart = apart && enclosure.alone(i);
    }
    return apart;
  }
};

TEST(ProofRounding, RadiiOfWeaklyCoupledBlocks) {
  // The slack of the other terms is nothing beside a radius of second order.
  Random random(5101);
  for (int trial = 0; trial < 200; ++trial) {
    NormsOfF norms(3);
    norms.coupling2 = 1e-20 * random.matrix(3, 3).cwiseAbs2();
    norms.separation = MatrixXd::Constant(3, 3, random.uniform(1, 2));
    EXPECT_TRUE(norms.prove_all());
  }
}

TEST(ProofRounding, RadiiOfOneGroup) {
  Random random(5102);
  for (int trial = 0; trial < 200; ++trial) {
    NormsOfF norms(3);
    norms.coupling2 = random.matrix(3, 3).cwiseAbs2();
    norms.own = random.log_uniform(1e-20, 1) * random.vector(3).cwiseAbs();
    norms.separation.setZero();
    EXPECT_FALSE(norms.prove_all());
  }
}

TEST(ProofRounding, SeparationsThatErrorsNearlyFill) {
  // delta is a small difference of large numbers: of the blocks' own errors, and of the coupling of
  // two other blocks, which is part of E22.
  Random random(5103);
  int apart = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    NormsOfF norms(4);
    const double wide = random.uniform(1, 2), delta = random.log_uniform(1e-9, 1e-7) * wide;
    const double share = trial % 3 == 0 ? 0 : trial % 3 == 1 ? 0.5 : random.uniform(0, 0.5);
    norms.own.setConstant(share * wide);
    norms.coupling2(2, 3) = std::pow((1 - 2 * share) * wide - delta, 2);
    norms.coupling2(0, 1) = norms.coupling2(1, 0) = 1e-4 * std::pow(delta, 4);
    norms.separation.setConstant(10);
    norms.separation(0, 1) = norms.separation(1, 0) = wide;
    norms.prove_all();
    apart += norms.enclosure.alone(0) ? 1 : 0;
  }
  EXPECT_GT(apart, 200);
}

TEST(ProofRounding, BlocksAtTheLimitOfTheTheorem) {
  // 4 |E12| |E21| = delta^2 within some units of the last place.
  Random random(5104);
  for (int trial = 0; trial < 2000; ++trial) {
    NormsOfF norms(2);
    const double ratio = random.uniform(1, 2), wide = random.uniform(1, 2);
    const double e = wide / (2 * std::sqrt(ratio) + std::sqrt(1 + ratio * ratio));
    norms.coupling2(0, 1) = std::pow(e * (1 - random.integer(-9, 9) * kEps), 2);
    norms.coupling2(1, 0) = std::pow(e * ratio, 2);
    norms.separation *= wide * (1 + (trial % 2) * 2e-10);
    EXPECT_EQ(norms.prove_all(), trial % 2 == 1);
  }
}

/// Two single eigenvalues, one joint.
ModalBasis<> basis_of_two(double first, double second) {
  ModalBasis<> basis;
  basis.U = MatrixXd::Ones(1, 2);
  basis.Lambda = Eigen::Vector2d(first, second).asDiagonal();
  basis.weight = MatrixXd::Identity(2, 2);
  basis.blocks.push_back({0, 1, false});
  basis.blocks.push_back({1, 1, false});
  return basis;
}

TEST(ProofRounding, SeparationsOfBlocksThatMove) {
  // Both move to almost the same place near 0, where the rounding errors of the moves are all that
  // counts.
  Random random(5105);
  int apart = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const double first = -random.uniform(0.1, 1), second = random.uniform(0.1, 1);
    ModalBasis<> basis = basis_of_two(first, second);
    const double gap = random.log_uniform(2e-9, 1e-7), coupling = 1e-3 * gap * gap;
    BasisResidual<> residual;
    residual.F_error = MatrixXd::Zero(2, 2);
    residual.F = MatrixXd::Constant(2, 2, coupling);
    residual.F(0, 0) = -first;
    residual.F(1, 1) = gap - second;
    const Long exact_gap = static_cast<Long>(second) + static_cast<Long>(residual.F(1, 1));
    BlockEnclosure<> enclosure;
    enclose<kDynamic>(residual, basis, enclosure);
    if (!enclosure.alone(0)) continue;
    ++apart;
    const auto e = static_cast<Long>(coupling);
    EXPECT_GE(static_cast<Long>(enclosure.radius[0]), 2 * e * e / (exact_gap - e * std::sqrt(2.0L)))
        << "trial " << trial;
  }
  EXPECT_GT(apart, 200);
}

TEST(ProofRounding, ErrorsThatAreNoNumbersProveNothing) {
  ModalBasis<> basis = basis_of_two(-1, -2);
  BasisResidual<> residual;
  residual.F = MatrixXd::Zero(2, 2);
  residual.F_error = Eigen::Vector2d(testing::kNan, 0).asDiagonal();
  BlockEnclosure<> enclosure;
  enclose<kDynamic>(residual, basis, enclosure);
  for (const double radius : enclosure.radius) EXPECT_EQ(radius, kInfinity);
}

TEST(ProofRounding, SeparationsOfBlocksWithAnEigenvalueInCommon) {
  // Triangular blocks with the same number on the diagonal, which no rounding error may part.
  Random random(5106);
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

// ------------------------------------------------------------------- from a block to eigenvalues

TEST(ProofRounding, DiscsReachToWhereTheirInequalityEnds) {
  // prod max(d, |mu - mu_j| / 2) = radius (norm + |mu| + d)^(k-1)
  Random random(5107);
  for (int trial = 0; trial < 4000; ++trial) {
    const int count = random.integer(2, 4);
    std::vector<Complex> values(static_cast<std::size_t>(count));
    const double spread = random.log_uniform(1e-6, 1);
    for (Complex& value : values) {
      value = Complex(-1, 1) + spread * Complex(random.uniform(-1, 1), random.uniform(-1, 1));
    }
    double radius = random.log_uniform(1e-16, 1), norm = random.log_uniform(1, 10);
    if (trial % 4 == 0) {
      // Where the search ends: with norm = 48 r the k-th power of d = 16 r is what is asked for.
      values.assign(3, 0);
      norm = 48 * radius * (1 + random.integer(-8, 8) * kEps);
    }
    const double disc =
        disc_radius(values.data(), static_cast<int>(values.size()), 0, norm, radius);
    const auto excess = [&](Long d) {
      const Long size = static_cast<Long>(norm) + std::abs(LongComplex(values[0])) + d;
      Long product = size / static_cast<Long>(radius);
      for (const Complex& value : values) {
        product *= std::max(d, std::abs(LongComplex(values[0]) - LongComplex(value)) / 2) / size;
      }
      return product;
    };
    const auto d = static_cast<Long>(disc);
    EXPECT_GE(excess(d), 1) << "trial " << trial << ", " << count << " values";
    EXPECT_LE(excess(d * (values.size() == 2 ? 1 - 1e-9L : 0.95L)), 1) << "trial " << trial;
  }
}

TEST(ProofRounding, FarthestPointsOfUnionsOfDiscs) {
  // Small discs inside of a wide one.
  Random random(5108);
  for (int trial = 0; trial < 500; ++trial) {
    std::array<BlockRoot, 4> roots;
    for (BlockRoot& root : roots) {
      root.value = {random.uniform(-1, 1), random.uniform(-1, 1)};
      root.radius = random.log_uniform(1e-20, 1e-3);
      root.block = 0;
    }
    roots[3].radius = modulus(roots[3].value) + 0.8;
    for (BlockRoot& root : roots) root.value *= trial % 2 == 0 ? 0.5 : 1.0;
    bound_roots(roots.data(), 4, std::array<int, 1>{0});
    for (const BlockRoot& root : roots) {
      Long farthest = 0;
      for (const BlockRoot& other : roots) {
        if (other.united != root.united) continue;
        farthest = std::max(farthest, std::abs(LongComplex(root.value) - LongComplex(other.value)) +
                                          static_cast<Long>(other.radius));
      }
      EXPECT_GE(static_cast<Long>(root.bound), farthest) << "trial " << trial;
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
