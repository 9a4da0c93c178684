#include <dashpot/analysis/tracker/two_sided_errors.hpp>

#include <dashpot/analysis/base/arithmetic.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Blocks = BlockEigenbasis::Entries;
/// One number for each state, row or column, read in fours; zero beyond the last.
using States = std::array<double, kMaxWidth + 4>;

double largest_of(const Vec4d& x) {
  return std::max(std::max(x[0], x[1]), std::max(x[2], x[3]));
}

/// Weights of the entries of a state, zero where they belong to the other half of it.
struct Weights {
  States position{}, inverse_position{}, velocity{}, elastic{};
  double mass = 0, damping = 0, stiffness = 0;  ///< |M|, |C| and |K|
  bool in_range = false;
};

Weights weights_of(const SymmetricPencil& pencil) {
  const int n = pencil.joints, p = pencil.rank;
  Weights weights;
  States inverse{};
  double smallest = std::numeric_limits<double>::infinity(), largest = 0;
  for (int k = 0; k < n; ++k) {
    const double diagonal = pencil.M[k + k * n];
    smallest = std::min(smallest, diagonal);
    largest = std::max(largest, diagonal);
    weights.velocity[at(p + k)] = std::sqrt(diagonal);
    inverse[at(k)] = 1 / weights.velocity[at(p + k)];
  }
  for (int k = 0; k < p; ++k) {
    weights.position[at(k)] = pencil.factored ? 1 : weights.velocity[at(p + k)];
    weights.inverse_position[at(k)] = pencil.factored ? 1 : inverse[at(k)];
  }
  weights.mass = largest_entry(pencil.M, n, inverse.data(), false);
  weights.damping = largest_entry(pencil.C, n, inverse.data(), false);
  if (!pencil.factored) weights.stiffness = largest_entry(pencil.W, n, inverse.data(), false);
  double rate = weights.damping + std::sqrt(weights.stiffness);
  for (int k = 0; pencil.factored && k < n; ++k) {
    double sum = 0;
    for (int i = 0; i < p; ++i) sum += std::abs(pencil.W[i + k * p]);
    weights.elastic[at(p + k)] = kSlack * sum;
    rate = std::max(rate, sum * inverse[at(k)]);
  }
  weights.in_range = smallest > 1e-120 && largest < 1e120 && rate < 1e60;
  return weights;
}

/// Root of the sum of squares, of `count` numbers.
double length(const Blocks& x, int count) {
  double squares = 0;
  for (int i = 0; i < count; ++i) squares += x[at(i)] * x[at(i)];
  return std::sqrt(squares);
}

/// For each block the length of what is there of its two columns, or of its only one.
void join(const BlockEigenbasis& basis, const States& x, Blocks& out) {
  const int m = basis.modes;
  for (int i = 0; i < m; i += 4) {
    const Vec4d first = load(&x[at(i)]), second = load(&x[at(m + i)]);
    store(&out[at(i)], square_root(first * first + second * second));
  }
  for (int k = 0; k < basis.zeros; ++k) out[at(m + k)] = x[at(2 * m + k)];
}

}  // namespace

TwoSidedErrors::TwoSidedErrors(const SymmetricPencil& pencil, const BlockEigenbasis& basis) noexcept
    // Two nested sums of p + n terms each, and the subtraction of N Lambda.
    : gamma_((2 * pencil.states() + 16) * kUnit) {
  const Weights weights = weights_of(pencil);
  in_range_ = weights.in_range;
  const int states = pencil.states(), width = basis.Z.width, blocks = basis.blocks();
  States a{}, b{}, p{}, z{}, e{}, t{};
  for (int i = 0; i < states; ++i) {
    Vec4d most{}, momenta{}, elastic{};
    for (int k = 0; k < width; k += 4) {
      const Vec4d y = magnitude(load(basis.Y.row(i) + k));
      const Vec4d position = y * load(&weights.inverse_position[at(k)]);
      most = position > most ? position : most;
      momenta += y * load(&weights.velocity[at(k)]);
      if (pencil.factored) elastic += y * load(&weights.elastic[at(k)]);
    }
    a[at(i)] = largest_of(most);
    p[at(i)] = sum(momenta);
    b[at(i)] = pencil.factored ? sum(elastic) : p[at(i)];
  }
  for (int j = 0; j < width; j += 4) {
    Vec4d positions{}, velocities{}, elastic{};
    for (int k = 0; k < pencil.rank; ++k) {
      positions += weights.position[at(k)] * magnitude(load(basis.Z.row(k) + j));
    }
    for (int k = pencil.rank; k < states; ++k) {
      const Vec4d v = magnitude(load(basis.Z.row(k) + j));
      velocities += weights.velocity[at(k)] * v;
      if (pencil.factored) elastic += weights.elastic[at(k)] * v;
    }
    store(&z[at(j)], positions);
    store(&e[at(j)], velocities);
    store(&t[at(j)], pencil.factored ? elastic : velocities);
  }
  Blocks positions{}, velocities{};
  join(basis, a, a_);
  join(basis, b, b_);
  join(basis, p, p_);
  join(basis, z, positions);
  join(basis, e, velocities);
  join(basis, t, x_);
  const double stiffness = pencil.factored ? 1 : weights.stiffness;
  double momenta2 = 0;
  for (int i = 0; i < blocks; ++i) {
    const double rate = i < basis.modes ? std::sqrt(basis.block(i).squared_norm())
                                        : std::abs(basis.rate[at(i - basis.modes)]);
    x_[at(i)] += positions[at(i)] * rate;
    f_[at(i)] = stiffness * positions[at(i)];
    m_[at(i)] = (weights.damping + weights.mass * rate) * velocities[at(i)];
    momenta2 += velocities[at(i)] * velocities[at(i)];
  }
  all_a_ = length(a_, blocks);
  all_b_ = length(b_, blocks);
  all_p_ = length(p_, blocks);
  all_x_ = length(x_, blocks);
  all_f_ = length(f_, blocks);
  all_m_ = length(m_, blocks);
  all_z_ = length(positions, blocks);
  all_momenta_ = weights.mass * std::sqrt(momenta2);
}

}  // namespace dashpot::analysis
