#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/tracked_enclosure.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// Largest distance of the Gram matrix from Sigma that is looked at as a perturbation.
constexpr double kNearlyOrthonormal = 0.1;

template <typename T>
T square(const T& x) {
  return x * x;
}

/// One number for each block, read in fours.
using Blocks = BlockEigenbasis::Entries;

/// One number for each state, row or column, read in fours.
using States = std::array<double, kMaxWidth + 4>;

/// Bound of the largest |A_ij| inverse_i inverse_j of A (n x n), from its upper triangle if it is
/// symmetric.
double largest_entry(const double* A, int n, const double* inverse, bool symmetric) {
  Vec4d largest{};
  double rest = 0;
  for (int j = 0; j < n; ++j) {
    const double* const column = A + j * n;
    const double factor = inverse[j];
    const int rows = symmetric ? j + 1 : n;
    int i = 0;
    for (; i + 4 <= rows; i += 4) {  // read in fours where a column has them
      const Vec4d entry = magnitude(load(column + i) * load(inverse + i)) * factor;
      largest = entry > largest ? entry : largest;
    }
    for (; i < rows; ++i) rest = std::max(rest, std::abs(column[i]) * inverse[i] * factor);
  }
  return kSlack * std::max({rest, largest[0], largest[1], largest[2], largest[3]});
}

/// Weights of the entries of a state; with two sides zero where they belong to its other half.
struct Weights {
  States position, inverse_position, velocity, elastic;
  double mass = 1, damping = 0, stiffness = 1;  ///< |M|, |C| and |K|
  bool in_range = false;
};

Weights weights_of(const SymmetricPencil& pencil, bool two_sided) {
  const int n = pencil.joints, p = pencil.rank;
  Weights weights;
  for (States* const x :
       {&weights.position, &weights.inverse_position, &weights.velocity, &weights.elastic}) {
    if (two_sided) x->fill(0);
  }
  std::array<double, kMaxDof> s, inverse;
  double smallest = kInfinity, largest = 0;
  for (int k = 0; k < n; ++k) {
    const double diagonal = pencil.M[k + k * n];
    smallest = std::min(smallest, diagonal);
    largest = std::max(largest, diagonal);
    s[at(k)] = std::sqrt(diagonal);
    inverse[at(k)] = 1 / s[at(k)];
  }
  const double mass = largest_entry(pencil.M, n, inverse.data(), !two_sided),
               damping = largest_entry(pencil.C, n, inverse.data(), !two_sided),
               K = pencil.factored ? 0 : largest_entry(pencil.W, n, inverse.data(), !two_sided),
               frequency = kSlack * std::sqrt(K);
  // On one side |M| is shared out among both e, and |K| among position and rate.
  const double momentum = two_sided ? 1 : std::sqrt(mass);
  double rate = damping + frequency;
  for (int k = 0; k < n; ++k) {
    double size = 0;
    const double* const W = pencil.W + k * p;
    if (pencil.factored && two_sided) {
      for (int i = 0; i < p; ++i) size += kSlack * std::abs(W[i]);
    } else if (pencil.factored) {
      for (int i = 0; i < p; ++i) size += W[i] * W[i];
      size = std::sqrt(size);
    }
    rate = std::max(rate, size * inverse[at(k)]);
    weights.velocity[at(p + k)] = momentum * s[at(k)];
    weights.elastic[at(p + k)] = pencil.factored ? size
                                 : two_sided     ? s[at(k)]
                                                 : frequency * s[at(k)];
  }
  for (int k = 0; k < p; ++k) {
    weights.position[at(k)] = pencil.factored ? 1 : two_sided ? s[at(k)] : frequency * s[at(k)];
    weights.inverse_position[at(k)] = pencil.factored ? 1 : inverse[at(k)];
  }
  if (two_sided) weights.mass = mass;
  weights.damping = damping / (two_sided ? 1 : mass);
  if (two_sided && !pencil.factored) weights.stiffness = K;
  weights.in_range = smallest > 1e-120 && largest < 1e120 && rate < 1e60;
  return weights;
}

/// Root of the sum of squares, of `count` numbers.
double length(const Blocks& x, int count) {
  double squares = 0;
  for (int i = 0; i < count; ++i) squares += x[at(i)] * x[at(i)];
  return std::sqrt(squares);
}

/// For each block the length of what x, or its root if it is `squared`, has of its two columns, or
/// of its only one.
void join(const BlockEigenbasis& basis, const States& x, bool squared, Blocks& out) {
  const int m = basis.modes;
  for (int i = 0; i < m; i += 4) {
    const Vec4d first = load(&x[at(i)]), second = load(&x[at(m + i)]);
    store(&out[at(i)], square_root(squared ? first + second : first * first + second * second));
  }
  for (int k = 0; k < basis.zeros; ++k) {
    const double only = x[at(2 * m + k)];
    out[at(m + k)] = squared ? std::sqrt(only) : only;
  }
}

/// Vectors a, b and p of the rows of Y.
void read_rows(const BlockEigenbasis& basis, const Weights& weights, Blocks& a_out, Blocks& b_out,
               Blocks& p_out) {
  States a{}, b{}, p{};
  for (int i = 0; i < basis.columns(); ++i) {
    Vec4d most{}, momenta{}, elastic{};
    for (int k = 0; k < basis.Y.width; k += 4) {
      const Vec4d y = magnitude(load(basis.Y.row(i) + k));
      const Vec4d position = y * load(&weights.inverse_position[at(k)]);
      most = position > most ? position : most;
      momenta += y * load(&weights.velocity[at(k)]);
      elastic += y * load(&weights.elastic[at(k)]);
    }
    a[at(i)] = std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
    b[at(i)] = sum(elastic);
    p[at(i)] = sum(momenta);
  }
  join(basis, a, false, a_out);
  join(basis, b, false, b_out);
  join(basis, p, false, p_out);
}

/// A number for each pair of blocks.
struct BlockTable {
  std::array<Blocks, kMaxDof> rows;
  double operator()(int i, int j) const { return rows[at(i)][at(j)]; }
};

/// Lower bounds of sep(Lambda_i, Lambda_j).
void find_separations(const BlockEigenbasis& basis, BlockTable& table) {
  const int m = basis.modes, blocks = basis.blocks();
  for (int j = 0; j < m; j += 4) {
    const MeasuredBlock<Vec4d> four(basis.blocks_from(j));
    for (int i = 0; i < m; ++i) {
      store(&table.rows[at(i)][at(j)], separation(MeasuredBlock<double>(basis.block(i)), four));
    }
    for (int i = m; i < blocks; ++i) {
      store(&table.rows[at(i)][at(j)], separation(basis.rate[at(i - m)], four));
    }
  }
  for (int j = m; j < blocks; ++j) {
    for (int i = 0; i < m; ++i) table.rows[at(i)][at(j)] = table(j, i);
    for (int i = m; i < blocks; ++i) {
      table.rows[at(i)][at(j)] = std::abs(basis.rate[at(i - m)] - basis.rate[at(j - m)]);
    }
  }
}

/// Whether no product of rates can underflow.
bool in_range(const BlockEigenbasis& basis) {
  bool slow = false;
  for (int i = 0; i < basis.modes; ++i) {
    const auto [a, b, c, d] = basis.block(i);
    const double rate = std::abs(a) + std::abs(b) + std::abs(c) + std::abs(d);
    slow |= rate != 0 && !(rate > 1e-60);
  }
  return !slow;
}

/// Squared norms of the blocks (i, 0) to (i, blocks) of X.
void row_squares(const BlockEigenbasis& basis, const PackedMatrix& X, int i, Blocks& out) {
  const int m = basis.modes;
  const double *const first = X.row(basis.first(i)), *const second = X.row(basis.second(i));
  const auto squares = [&](int column) {
    const Vec4d upper = square(load(first + column));
    return i < m ? upper + square(load(second + column)) : upper;
  };
  for (int j = 0; j < m; j += 4) store(&out[at(j)], squares(j) + squares(m + j));
  for (int k = 0; k < basis.zeros; k += 4) store(&out[at(m + k)], squares(2 * m + k));
}

}  // namespace

ResidualErrors::ResidualErrors(const SymmetricPencil& pencil, const BlockEigenbasis& basis) noexcept
    // Two nested sums of p + n terms each, and the subtraction of N Lambda.
    : gamma_((2 * pencil.states() + 16) * kUnit) {
  const Weights weights = weights_of(pencil, basis.two_sided);
  in_range_ = weights.in_range;
  const bool squared = pencil.factored && !basis.two_sided;
  const int m = basis.modes, blocks = basis.blocks();
  States z, e, t;
  for (int j = 0; j < basis.Z.width; j += 4) {
    Vec4d positions{}, velocities{}, elastic{};
    for (int k = 0; k < pencil.rank; ++k) {
      const Vec4d q = load(basis.Z.row(k) + j);
      positions += squared ? q * q : weights.position[at(k)] * magnitude(q);
    }
    for (int k = pencil.rank; k < pencil.states(); ++k) {
      const Vec4d v = magnitude(load(basis.Z.row(k) + j));
      velocities += weights.velocity[at(k)] * v;
      elastic += weights.elastic[at(k)] * v;
    }
    store(&z[at(j)], positions);
    store(&e[at(j)], velocities);
    store(&t[at(j)], elastic);
  }
  Blocks positions{}, velocities{};
  join(basis, z, squared, positions);
  join(basis, e, false, velocities);
  join(basis, t, false, x_);
  if (basis.two_sided) {
    read_rows(basis, weights, a_, b_, p_);
  } else {
    a_ = positions, b_ = x_, p_ = velocities;
  }
  Blocks rates{};
  for (int i = 0; i < m; i += 4) {
    store(&rates[at(i)], square_root(basis.blocks_from(i).squared_norm()));
  }
  for (int k = 0; k < basis.zeros; ++k) rates[at(m + k)] = std::abs(basis.rate[at(k)]);
  for (int i = 0; i < blocks; i += 4) {
    const Vec4d position = load(&positions[at(i)]), rate = load(&rates[at(i)]);
    store(&x_[at(i)], load(&x_[at(i)]) + position * rate);
    store(&f_[at(i)], weights.stiffness * position);
    store(&m_[at(i)], (weights.damping + weights.mass * rate) * load(&velocities[at(i)]));
  }
  all_z_ = length(positions, blocks);
  const double all_velocities = length(velocities, blocks);
  all_a_ = basis.two_sided ? length(a_, blocks) : all_z_;
  all_b_ = length(b_, blocks);
  all_p_ = basis.two_sided ? length(p_, blocks) : all_velocities;
  all_x_ = length(x_, blocks);
  all_f_ = weights.stiffness * all_z_;
  all_m_ = length(m_, blocks);
  all_momenta_ = weights.mass * all_velocities;
}

void enclose(const SymmetricPencil& pencil, const BlockEigenbasis& basis,
             const TrackedResidual& residual, TrackedEnclosure& enclosure) noexcept {
  const ResidualErrors errors(pencil, basis);
  const int blocks = basis.blocks();
  enclosure.reset(blocks);
  enclosure.roundoff_bound = errors.of_G();
  BlockTable coupling, separations;
  Blocks R_rows{}, G_columns{}, own;
  double R_total = 0;
  for (int i = 0; i < blocks; ++i) {
    Blocks R;
    row_squares(basis, residual.R, i, R);
    for (int j = 0; j < blocks; ++j) R_rows[at(i)] += R[at(j)];
    R_total += R_rows[at(i)];
    Blocks& G = coupling.rows[at(i)];
    row_squares(basis, residual.G, i, G);
    if (i < basis.modes) G[at(i)] = residual.diagonal[at(i)];
    for (int j = 0; j < blocks; j += 4) {
      store(&G_columns[at(j)], load(&G_columns[at(j)]) + load(&G[at(j)]));
    }
  }
  const double R_norm = std::sqrt(R_total) + errors.of_N();
  if (!errors.in_range() || !in_range(basis) || !(R_norm < kNearlyOrthonormal)) return;
  // F = Sigma (G - R F), and so |F| <= |G| / (1 - |R|) for each column.
  for (int j = 0; j < blocks; j += 4) {
    const Vec4d columns = square_root(load(&G_columns[at(j)])) + errors.of_columns(j);
    store(&G_columns[at(j)], kSlack * columns / (1 - R_norm));
  }
  for (int i = 0; i < blocks; ++i) {
    const double R = std::sqrt(R_rows[at(i)]) + errors.of_N(i);
    Blocks& row = coupling.rows[at(i)];
    for (int j = 0; j < blocks; j += 4) {
      const Vec4d F = kSlack * (square_root(load(&row[at(j)])) + errors.of_G(i, j) +
                                R * load(&G_columns[at(j)]));
      if (i >= j && i < j + 4) own[at(i)] = F[i - j];
      store(&row[at(j)], square(F));
    }
  }
  find_separations(basis, separations);
  prove(PerturbationBounds<BlockTable, Blocks>{coupling, separations, own}, enclosure);
}

}  // namespace dashpot::analysis
