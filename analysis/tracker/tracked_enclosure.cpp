#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/tracked_enclosure.hpp>
#include <dashpot/analysis/tracker/two_sided_errors.hpp>

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

/// Sizes of the coefficients, for bounds of rounding errors. With
/// s_k = sqrt(M_kk), entrywise |M| <= mass s s', |C| <= damping s s' and |K| <= stiffness^2 s s'
/// (without a factor). Column k of W is no longer than elastic[k].
struct CoefficientSizes {
  std::array<double, kMaxDof> s{}, elastic{};
  double mass = 0, damping = 0, stiffness = 0;
  bool in_range = false;  ///< masses and rates are not too large or too small
};

CoefficientSizes coefficient_sizes(const SymmetricPencil& pencil) {
  const int n = pencil.joints;
  CoefficientSizes sizes;
  std::array<double, kMaxDof> inverse{};
  double smallest = kInfinity, largest = 0;
  for (int k = 0; k < n; ++k) {
    const double diagonal = pencil.M[k + k * n];
    smallest = std::min(smallest, diagonal);
    largest = std::max(largest, diagonal);
    sizes.s[at(k)] = std::sqrt(diagonal);
    inverse[at(k)] = 1 / sizes.s[at(k)];
  }
  const double mass = largest_entry(pencil.M, n, inverse.data(), true),
               damping = largest_entry(pencil.C, n, inverse.data(), true);
  const double stiffness = pencil.factored ? 0 : largest_entry(pencil.W, n, inverse.data(), true);
  for (int j = 0; pencil.factored && j < n; ++j) {
    double W = 0;
    for (int i = 0; i < pencil.rank; ++i) W += square(pencil.W[i + j * pencil.rank]);
    sizes.elastic[at(j)] = std::sqrt(W);
  }
  sizes.mass = mass;
  sizes.damping = damping;
  sizes.stiffness = kSlack * std::sqrt(stiffness);
  if (!pencil.factored) {
    for (int k = 0; k < n; ++k) sizes.elastic[at(k)] = sizes.stiffness * sizes.s[at(k)];
  }
  const double rate = sizes.damping + sizes.stiffness;
  sizes.in_range = smallest > 1e-120 && largest < 1e120 && rate < 1e60;
  return sizes;
}

/// One number for each block, read in fours.
using Blocks = BlockEigenbasis::Entries;

/// Errors of N and G, entrywise, with the vectors a, b, m (one entry a column of Z) and a factor
/// gamma:   |N error| <= gamma (a a' + m m'),   |Z' B Z error| <= gamma (a b' + b a' + c m m').
/// a is the size of a column's elastic coordinates, b of the elastic rates W v of its velocities, m
/// of its momenta. They are kept for each block, with a and m times |Lambda_i|.
class ErrorSizes {
 public:
  ErrorSizes(const SymmetricPencil& pencil, const CoefficientSizes& sizes,
             const BlockEigenbasis& basis)
      // Two nested sums of p + n terms each, and the subtraction of N Lambda.
      : gamma_((2 * pencil.states() + 16) * kUnit), c_(sizes.damping / sizes.mass) {
    Columns a2, b_columns, m_columns;
    read_columns(pencil, sizes, basis, a2, b_columns, m_columns);
    const auto set = [&](int i, int first, int second, double both, const Vec4d& rate) {
      const auto norm = [&](const Columns& x, bool squared) {
        const Vec4d y = load(&x[at(first)]), z = both * load(&x[at(second)]);
        return square_root(squared ? y + z : y * y + z * z);
      };
      const Vec4d a_i = norm(a2, true), m_i = norm(m_columns, false);
      store(&a_[at(i)], a_i);
      store(&b_[at(i)], norm(b_columns, false));
      store(&m_[at(i)], m_i);
      store(&a_rate_[at(i)], a_i * rate);
      store(&m_rate_[at(i)], m_i * rate);
    };
    for (int i = 0; i < basis.modes; i += 4) {
      set(i, i, basis.modes + i, 1, square_root(basis.blocks_from(i).squared_norm()));
    }
    for (int k = 0; k < basis.zeros; k += 4) {
      const int column = 2 * basis.modes + k;
      set(basis.modes + k, column, column, 0, magnitude(load(&basis.rate[at(k)])));
    }
    const auto norm = [&](const Blocks& x) {
      double squares = 0;
      for (int i = 0; i < basis.blocks(); ++i) squares += square(x[at(i)]);
      return std::sqrt(squares);
    };
    all_a_ = norm(a_);
    all_b_ = norm(b_);
    all_m_ = norm(m_);
    all_a_rate_ = norm(a_rate_);
    all_m_rate_ = norm(m_rate_);
  }

  /// Bounds of the errors of blocks (i, j) to (i, j + 3) of G.
  Vec4d of_G(int i, int j) const {
    const std::size_t k = at(i);
    return gamma_ * (a_[k] * (four(b_, j) + four(a_rate_, j)) + b_[k] * four(a_, j) +
                     m_[k] * (c_ * four(m_, j) + four(m_rate_, j)));
  }
  /// Error of block columns j to j + 3 of G.
  Vec4d of_columns(int j) const {
    return gamma_ * (all_a_ * (four(b_, j) + four(a_rate_, j)) + all_b_ * four(a_, j) +
                     all_m_ * (c_ * four(m_, j) + four(m_rate_, j)));
  }
  /// Errors of all of G, of block row i of N, and of all of N.
  double of_G() const {
    return gamma_ * (all_a_ * (2 * all_b_ + all_a_rate_) + all_m_ * (c_ * all_m_ + all_m_rate_));
  }
  double of_N(int i) const { return gamma_ * (a_[at(i)] * all_a_ + m_[at(i)] * all_m_); }
  double of_N() const { return gamma_ * (all_a_ * all_a_ + all_m_ * all_m_); }

 private:
  using Columns = std::array<double, kMaxWidth + 4>;
  static Vec4d four(const Blocks& x, int j) { return load(&x[at(j)]); }
  static void read_columns(const SymmetricPencil& pencil, const CoefficientSizes& sizes,
                           const BlockEigenbasis& basis, Columns& a2, Columns& b, Columns& m);

  double gamma_, c_;
  Blocks a_, b_, m_, a_rate_, m_rate_;
  double all_a_, all_b_, all_m_, all_a_rate_, all_m_rate_;  ///< of all columns
};

/// a^2, b and m of each column.
void ErrorSizes::read_columns(const SymmetricPencil& pencil, const CoefficientSizes& sizes,
                              const BlockEigenbasis& basis, Columns& a2, Columns& b, Columns& m) {
  const int p = pencil.rank, width = basis.Z.width;
  const double mass = std::sqrt(sizes.mass);
  for (int j = 0; j < width; j += 4) {
    Vec4d a_sum{}, b_sum{}, m_sum{};
    const auto entries = [&](int row) { return magnitude(load(basis.Z.row(row) + j)); };
    if (pencil.factored) {
      for (int k = 0; k < p; ++k) {
        const Vec4d z = load(basis.Z.row(k) + j);
        a_sum += z * z;
      }
    } else {
      for (int k = 0; k < p; ++k) a_sum += (sizes.stiffness * sizes.s[at(k)]) * entries(k);
      a_sum *= a_sum;
    }
    for (int k = 0; k < pencil.joints; ++k) {
      const Vec4d v = entries(p + k);
      b_sum += sizes.elastic[at(k)] * v;
      m_sum += (mass * sizes.s[at(k)]) * v;
    }
    store(&a2[at(j)], a_sum);
    store(&b[at(j)], b_sum);
    store(&m[at(j)], m_sum);
  }
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

/// `errors` bounds the rounding errors of the residual.
template <class Errors>
void prove_blocks(const BlockEigenbasis& basis, const TrackedResidual& residual,
                  const Errors& errors, bool coefficients_in_range, TrackedEnclosure& enclosure) {
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
  if (!coefficients_in_range || !in_range(basis) || !(R_norm < kNearlyOrthonormal)) return;
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

}  // namespace

double largest_entry(const double* A, int n, const double* inverse, bool symmetric) noexcept {
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

void enclose(const SymmetricPencil& pencil, const BlockEigenbasis& basis,
             const TrackedResidual& residual, TrackedEnclosure& enclosure) noexcept {
  if (basis.two_sided) {
    const TwoSidedErrors errors(pencil, basis);
    prove_blocks(basis, residual, errors, errors.in_range(), enclosure);
    return;
  }
  const CoefficientSizes sizes = coefficient_sizes(pencil);
  const ErrorSizes errors(pencil, sizes, basis);
  prove_blocks(basis, residual, errors, sizes.in_range, enclosure);
}

}  // namespace dashpot::analysis
