// Each term of the radii that are proved for a tracked basis: where it is attained, and the value
// of all of them together against the formula in long double; and what becomes of the radii.
#include <dashpot/analysis/tracker/tracked_enclosure.hpp>
#include <dashpot/analysis/tracker/tracked_modes.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/special_values.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <vector>

namespace dashpot::analysis {
namespace {

using testing::kInfinity;
using testing::Random;
using Long = long double;

Long wide(double x) {
  return static_cast<Long>(x);
}
Long square(double x) {
  return wide(x) * wide(x);
}

/// A basis of a system with p modes and n - p zero modes, and a residual made up by hand.
struct HandMade {
  System<kMaxDof> system;
  BlockEigenbasis basis;
  TrackedResidual residual;
  TrackedEnclosure enclosure;

  HandMade(int n, int p) : system(n) {
    system.stiffness_factor.setIdentity(p, n);
    basis.modes = p;
    basis.zeros = n - p;
    const int width = packed_width(p, n - p);
    for (PackedMatrix* X : {&basis.Z, &residual.R, &residual.G}) set_zero(width, n + p, *X);
  }
  void prove() { enclose(symmetric_pencil(system), basis, residual, enclosure); }

  /// The columns of block i.
  std::vector<int> columns(int i) const {
    if (i >= basis.modes) return {basis.first(i)};
    return {basis.first(i), basis.second(i)};
  }
  Long squares(const PackedMatrix& X, int i, int j) const {
    Long sum = 0;
    for (const int row : columns(i)) {
      for (const int column : columns(j)) sum += square(X(row, column));
    }
    return sum;
  }
  Long rate(int i) const {
    if (i >= basis.modes)
      return std::abs(wide(basis.rate[static_cast<std::size_t>(i - basis.modes)]));
    const auto [a, b, c, d] = basis.block(i);
    return std::sqrt(square(a) + square(b) + square(c) + square(d));
  }
  double separation_of(int i, int j) const {
    const auto rate_of = [&](int k) {
      return basis.rate[static_cast<std::size_t>(k - basis.modes)];
    };
    const bool zero_i = i >= basis.modes, zero_j = j >= basis.modes;
    if (zero_i && zero_j) return std::abs(rate_of(i) - rate_of(j));
    if (zero_i || zero_j) {
      return separation(rate_of(zero_i ? i : j),
                        MeasuredBlock<double>(basis.block(zero_i ? j : i)));
    }
    return separation(MeasuredBlock<double>(basis.block(i)), MeasuredBlock<double>(basis.block(j)));
  }
};

/// The radius of each block, if it is a group by itself, by the formulas of tracked_enclosure.cpp
/// and enclosure.hpp. Empty if the Gram matrix is too far from Sigma.
std::vector<Long> expected_radii(const HandMade& made) {
  const System<kMaxDof>& system = made.system;
  const BlockEigenbasis& basis = made.basis;
  const int n = basis.modes + basis.zeros, p = basis.modes, blocks = basis.blocks();
  const Long gamma = (2 * (n + p) + 16) * std::ldexp(1.0L, -53);
  Long mass = 0, damping = 0;
  std::vector<Long> s, elastic;
  for (int k = 0; k < n; ++k) s.push_back(std::sqrt(wide(system.mass(k, k))));
  for (int k = 0; k < n; ++k) elastic.push_back(wide(system.stiffness_factor.col(k).norm()));
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      mass = std::max(mass, std::abs(wide(system.mass(i, j))) / (s[at(i)] * s[at(j)]));
      damping = std::max(damping, std::abs(wide(system.damping(i, j))) / (s[at(i)] * s[at(j)]));
    }
  }
  std::vector<Long> a(at(blocks)), b = a, m = a;
  Long all_a = 0, all_b = 0, all_m = 0, all_a_rate = 0, all_m_rate = 0;
  for (int i = 0; i < blocks; ++i) {
    for (const int column : made.columns(i)) {
      Long b_column = 0, m_column = 0;
      for (int k = 0; k < p; ++k) {
        a[at(i)] += square(basis.Z(k, column));
      }
      for (int k = 0; k < n; ++k) {
        b_column += elastic[at(k)] * std::abs(wide(basis.Z(p + k, column)));
        m_column += std::sqrt(mass) * s[at(k)] * std::abs(wide(basis.Z(p + k, column)));
      }
      b[at(i)] += b_column * b_column;
      m[at(i)] += m_column * m_column;
    }
    const Long rate = made.rate(i);
    all_a += a[at(i)], all_b += b[at(i)], all_m += m[at(i)];
    all_a_rate += a[at(i)] * rate * rate, all_m_rate += m[at(i)] * rate * rate;
    for (std::vector<Long>* x : {&a, &b, &m}) (*x)[at(i)] = std::sqrt((*x)[at(i)]);
  }
  for (Long* x : {&all_a, &all_b, &all_m, &all_a_rate, &all_m_rate}) *x = std::sqrt(*x);
  const Long c = damping / mass;
  Long R_all = 0;
  std::vector<Long> R(at(blocks)), G(at(blocks));
  for (int i = 0; i < blocks; ++i) {
    for (int j = 0; j < blocks; ++j) {
      R[at(i)] += made.squares(made.residual.R, i, j);
      G[at(j)] += i == j && i < p ? wide(made.residual.diagonal[at(i)])
                                  : made.squares(made.residual.G, i, j);
    }
    R_all += R[at(i)];
    R[at(i)] = std::sqrt(R[at(i)]) + gamma * (a[at(i)] * all_a + m[at(i)] * all_m);
  }
  R_all = std::sqrt(R_all) + gamma * (all_a * all_a + all_m * all_m);
  if (!(R_all < 0.1L)) return {};
  std::vector<std::vector<Long>> F(at(blocks), std::vector<Long>(at(blocks)));
  for (int j = 0; j < blocks; ++j) {
    const Long aj = a[at(j)], bj = b[at(j)], mj = m[at(j)], rate = made.rate(j);
    const Long column = (std::sqrt(G[at(j)]) + gamma * (all_a * (bj + aj * rate) + all_b * aj +
                                                        all_m * (c * mj + mj * rate))) /
                        (1 - R_all);
    for (int i = 0; i < blocks; ++i) {
      const Long own = i == j && i < p ? wide(made.residual.diagonal[at(i)])
                                       : made.squares(made.residual.G, i, j);
      F[at(i)][at(j)] =
          std::sqrt(own) +
          gamma * (a[at(i)] * (bj + aj * rate) + b[at(i)] * aj + m[at(i)] * (c * mj + mj * rate)) +
          R[at(i)] * column;
    }
  }
  Long everything = 0, largest = 0;
  for (int i = 0; i < blocks; ++i) {
    largest = std::max(largest, F[at(i)][at(i)]);
    for (int j = 0; j < blocks; ++j) {
      everything += i == j ? 0 : F[at(i)][at(j)] * F[at(i)][at(j)];
    }
  }
  everything = std::sqrt(everything) + largest;
  std::vector<Long> radii;
  for (int i = 0; i < blocks; ++i) {
    Long right = 0, left = 0, apart = wide(kInfinity);
    for (int j = 0; j < blocks; ++j) {
      if (j == i) continue;
      right += F[at(i)][at(j)] * F[at(i)][at(j)];
      left += F[at(j)][at(i)] * F[at(j)][at(i)];
      apart = std::min(apart, wide(made.separation_of(i, j)));
    }
    const Long own = F[at(i)][at(i)];
    radii.push_back(own + 2 * std::sqrt(right * left) / (apart - own - everything));
  }
  return radii;
}

TEST(TrackedProofTerms, ARateIsEnclosedForEveryGramMatrix) {
  // (r - 1) F = g for the one column of a zero mode: |F| = g / (1 - r), which is attained.
  for (const double r : {1e-3, 0.05, 0.099}) {
    HandMade made(2, 1);
    made.basis.l01[0] = 100;
    made.basis.l10[0] = -100;
    made.basis.rate[0] = -1;
    made.residual.R(2, 2) = r;
    made.residual.G(2, 2) = 0.25;
    made.prove();
    const Long exact = 0.25L / (1 - wide(r));
    EXPECT_GE(wide(made.enclosure.radius[1]), exact) << r;
    EXPECT_LE(wide(made.enclosure.radius[1]), exact * (1 + 1e-8L)) << r;
  }
}

TEST(TrackedProofTerms, RadiiAreThoseOfTheFormula) {
  Random random(2501);
  int compared = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const int n = random.integer(1, 6), p = random.integer(1, n);
    HandMade made(n, p);
    made.system.mass = random.log_uniform(1e-2, 1e2) * random.spd(n);
    made.system.damping = random.log_uniform(1e-2, 1e2) * random.spd(n);
    made.system.stiffness_factor = random.log_uniform(1e-2, 1e2) * random.matrix(p, n);
    const double length = random.log_uniform(1, 1e7);  // long columns have rounding errors
    const double R = random.log_uniform(1e-6, 1e-2), G = random.log_uniform(1e-6, 1e-1);
    for (int i = 0; i < n + p; ++i) {
      for (int j = 0; j < n + p; ++j) {
        const double s = i < p ? 1 : 1 / std::sqrt(made.system.mass(i - p, i - p));
        made.basis.Z(i, j) = length * s * random.uniform(-1, 1);
        made.residual.R(i, j) = R * random.uniform(-1, 1);
        made.residual.G(i, j) = G * random.uniform(-1, 1);
      }
    }
    for (int i = 0; i < p; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double omega = 100 * (i + 1) + random.uniform(-20, 20);
      made.basis.l00[k] = random.uniform(-20, 0);
      made.basis.l11[k] = random.uniform(-20, 0);
      made.basis.l01[k] = omega;
      made.basis.l10[k] = -omega;
      made.residual.diagonal[k] = random.log_uniform(1e-12, 1e-2);
    }
    for (int k = 0; k < n - p; ++k) {
      made.basis.rate[static_cast<std::size_t>(k)] = -10 * k + random.uniform(-3, 3);
    }
    made.prove();
    const std::vector<Long> radii = expected_radii(made);
    for (int i = 0; i < made.basis.blocks(); ++i) {
      if (radii.empty()) {
        EXPECT_EQ(made.enclosure.radius[i], kInfinity) << "trial " << trial;
      } else if (made.enclosure.alone(i)) {
        ++compared;
        const Long share = wide(made.enclosure.radius[i]) / radii[static_cast<std::size_t>(i)];
        EXPECT_GE(share, 1) << "trial " << trial << ", block " << i;
        EXPECT_LE(share, 1 + 1e-8L) << "trial " << trial << ", block " << i;
      }
    }
  }
  EXPECT_GT(compared, 500);
}

TEST(TrackedProofTerms, NothingIsProvedBeyondTheRangeOfNumbers) {
  // Products of such masses, and of such rates, may overflow or underflow.
  for (const auto& [mass, stiffness] : {std::pair{1e-121, 1e-121}, {1e121, 1e121}, {1.0, 1e122}}) {
    HandMade made(1, 1);
    made.system.mass *= mass;
    made.system.stiffness_factor.resize(0, 1);
    made.system.stiffness.setConstant(1, 1, stiffness);
    made.basis.l01[0] = 1;
    made.basis.l10[0] = -1;
    made.prove();
    EXPECT_EQ(made.enclosure.radius[0], kInfinity) << mass << ", " << stiffness;
  }
}

/// The modes of blocks [a b; c d] with these radii and groups.
TrackedSpectrum modes_of(const std::vector<std::array<double, 4>>& blocks, double radius,
                         bool alone, double soft_frequency, std::array<bool, kMaxDof>& soft) {
  BlockEigenbasis basis;
  basis.modes = static_cast<int>(blocks.size());
  TrackedEnclosure enclosure;
  enclosure.reset(basis.modes);
  enclosure.radius.setConstant(radius);
  if (!alone) enclosure.group.setZero();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    basis.l00[i] = blocks[i][0], basis.l01[i] = blocks[i][1];
    basis.l10[i] = blocks[i][2], basis.l11[i] = blocks[i][3];
  }
  TrackedSpectrum spectrum;
  read_numbers(basis, enclosure, soft_frequency, soft, spectrum);
  return spectrum;
}

TEST(TrackedProofTerms, RoundingErrorsOfEigenvaluesOfABlock) {
  Random random(2502);
  for (int trial = 0; trial < 300; ++trial) {  // near critical damping, where they are largest
    const double a = random.uniform(-2, -1), d = random.uniform(-2, -1), b = random.uniform(1, 2);
    const double c = -0.25 * (a - d) * (a - d) / b * (1 + random.log_uniform(1e-16, 1e-8));
    std::array<bool, kMaxDof> soft{};
    const TrackedSpectrum spectrum = modes_of({{a, b, c, d}}, 0, true, 0, soft);
    const Long half = (wide(a) - wide(d)) / 2;
    const std::complex<Long> root =
        std::sqrt(std::complex<Long>(half * half + wide(b) * wide(c), 0));
    const std::complex<Long> mean = (wide(a) + wide(d)) / 2;
    for (const Complex& value : spectrum.modes[0].eigenvalues) {
      const std::complex<Long> z(value);
      const Long error = std::min(std::abs(z - mean - root), std::abs(z - mean + root));
      EXPECT_LE(error, wide(spectrum.modes[0].error_bound)) << "trial " << trial;
    }
  }
}

TEST(TrackedProofTerms, FrequenciesOfAGroupAreThoseOfTheUnionOfItsDiscs) {
  // Two modes of one group 1.5 radii apart: either eigenvalue may be 2.5 radii away.
  constexpr double kRadius = 1e-3;
  for (const bool alone : {true, false}) {
    std::array<bool, kMaxDof> soft{};
    const TrackedSpectrum spectrum =
        modes_of({{-0.1, 10, -10, -0.1}, {-0.1, 10 + 1.5 * kRadius, -10 - 1.5 * kRadius, -0.1}},
                 kRadius, alone, 0, soft);
    EXPECT_EQ(spectrum.modes[0].natural_frequency_bound > 2.4 * kRadius, !alone);
    EXPECT_EQ(spectrum.modes[0].error_bound > 3 * kRadius, !alone);  // 2.4 are a disc
  }
}

TEST(TrackedProofTerms, ASoftModeStaysSoftUpToTwiceTheFrequency) {
  std::array<bool, kMaxDof> soft{};
  const auto kind_at = [&soft](double omega) {
    return modes_of({{-0.1, omega, -omega, -0.1}}, 1e-9, true, 1, soft).modes[0].kind;
  };
  EXPECT_EQ(kind_at(1.5), ModeKind::kUnderdamped);
  EXPECT_EQ(kind_at(0.9), ModeKind::kSoft);
  EXPECT_EQ(kind_at(1.5), ModeKind::kSoft);
  EXPECT_EQ(kind_at(2.1), ModeKind::kUnderdamped);
  EXPECT_EQ(kind_at(1.5), ModeKind::kUnderdamped);
}

}  // namespace
}  // namespace dashpot::analysis
