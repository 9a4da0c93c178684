#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/residual_errors.hpp>
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
