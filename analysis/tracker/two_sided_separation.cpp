#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/tracker/two_sided_basis.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

/// Columns whose inverse is larger than this separate nothing.
constexpr double kIllConditioned = 1e5;
/// Couplings that a division may leave, relative to the whole: Newton's method removes them.
constexpr double kCoupled = 1e-2;

/// k x l, k and l <= 4
using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 4, 4>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 4, 1>;

/// Two blocks: their columns, and how the system acts on them, A = N^-1 T.
struct BlockPair {
  std::array<int, 4> columns{};
  int size = 0, split = 0;  ///< columns of both, and of the first
  Small A;
  std::array<Complex, 4> values{};
};

bool pose(const TrackedResidual& residual, const CloseBlocks& close, const BlockEigenbasis& basis,
          BlockPair& pair) {
  const int m = basis.modes;
  for (const int block : {close.first, close.second}) {
    pair.split = pair.size;
    pair.columns[at(pair.size++)] = basis.first(block);
    if (block < m) pair.columns[at(pair.size++)] = basis.second(block);
  }
  Small N(pair.size, pair.size), Lambda = Small::Zero(pair.size, pair.size);
  pair.A.resize(pair.size, pair.size);
  int first = 0;
  for (const int block : {close.first, close.second}) {
    if (block < m) {
      const Block2<double> L = basis.block(block);
      Lambda.block(first, first, 2, 2) << L.a, L.b, L.c, L.d;
      first += 2;
    } else {
      Lambda(first, first) = basis.rate[at(block - m)];
      ++first;
    }
  }
  for (int i = 0; i < pair.size; ++i) {
    for (int j = 0; j < pair.size; ++j) {
      const int row = pair.columns[at(i)], column = pair.columns[at(j)];
      N(i, j) = residual.R(row, column) + (row != column ? 0.0 : row < m ? 1.0 : -1.0);
      pair.A(i, j) = residual.G(row, column);
    }
  }
  solve_in_place(N, pair.A, std::numeric_limits<double>::min());
  pair.A += Lambda;
  if (!pair.A.allFinite()) return false;
  Small H = pair.A;
  reduce_to_hessenberg(H);
  return hessenberg_eigenvalues(H, pair.values.data());
}

/// Orthonormal columns of X, the longest first.
Small range(Small X, int count) {
  Small Q(X.rows(), count);
  for (int k = 0; k < count; ++k) {
    Eigen::Index longest = 0;
    X.colwise().squaredNorm().maxCoeff(&longest);
    Q.col(k) = X.col(longest).normalized();
    X -= Q.col(k) * (Q.col(k).transpose() * X).eval();
    X -= Q.col(k) * (Q.col(k).transpose() * X).eval();
  }
  return Q;
}

/// The space of the eigenvalues in `set`: the range of the product of A - mu for all others, real
/// because complex ones come in pairs.
Small space(const BlockPair& pair, unsigned set, int dimension) {
  Small product = Small::Identity(pair.size, pair.size);
  for (int i = 0; i < pair.size; ++i) {
    const Complex mu = pair.values[at(i)];
    if ((set >> i & 1) != 0 || mu.imag() < 0) continue;
    const Small shifted = pair.A - mu.real() * Small::Identity(pair.size, pair.size);
    Small factor = shifted;
    if (mu.imag() > 0) {
      factor = shifted * shifted;
      factor.diagonal().array() += mu.imag() * mu.imag();
    }
    product = (product * factor).eval();
  }
  return range(product, dimension);
}

/// Whether conjugates go together.
bool is_closed(const BlockPair& pair, unsigned set) {
  for (int i = 0; i < pair.size; ++i) {
    for (int j = 0; j < pair.size; ++j) {
      const bool conjugate =
          pair.values[at(i)].imag() != 0 && pair.values[at(j)] == std::conj(pair.values[at(i)]);
      if (conjugate && (set >> i & 1) != (set >> j & 1)) return false;
    }
  }
  return true;
}

/// The plane of x and A x, which is invariant where both blocks have the same eigenvalues and no
/// others.
Small krylov_plane(const BlockPair& pair, int column) {
  Small both(pair.size, 2);
  both.col(0) = SmallVector::Unit(pair.size, column);
  both.col(1) = pair.A.col(column);
  return range(both, 2);
}

/// A division: columns X, what is left of the coupling, and how much of the old blocks the new
/// ones have.
struct Division {
  Small X, inverse;
  double share = -1;
};

void consider(const BlockPair& pair, const Small& first, const Small& second, Division& best) {
  const int size = pair.size, split = pair.split;
  Small X(size, size);
  X << first, second;
  Small copy = X, inverse = Small::Identity(size, size);
  solve_in_place(copy, inverse, std::numeric_limits<double>::min());
  if (!(inverse.norm() < kIllConditioned)) return;
  const Small divided = inverse * pair.A * X;
  const double coupling = divided.topRightCorner(split, size - split).norm() +
                          divided.bottomLeftCorner(size - split, split).norm();
  if (!(coupling <= kCoupled * pair.A.norm())) return;
  const double share =
      first.topRows(split).squaredNorm() + second.bottomRows(size - split).squaredNorm();
  if (share > best.share) best = {X, inverse, share};
}

}  // namespace

bool separate_two_sided(const TrackedResidual& residual, const CloseBlocks& close,
                        BlockEigenbasis& basis) noexcept {
  BlockPair pair;
  if (!pose(residual, close, basis, pair)) return false;
  const int size = pair.size, split = pair.split, rest = size - split;
  Division best;
  for (unsigned set = 0; set < 1U << size; ++set) {
    if (__builtin_popcount(set) != split || !is_closed(pair, set)) continue;
    consider(pair, space(pair, set, split), space(pair, ~set, rest), best);
  }
  if (split == 2 && rest == 2) {
    consider(pair, krylov_plane(pair, 0), krylov_plane(pair, 2), best);
  }
  if (best.share < 0) return false;
  for (int row = 0; row < basis.columns(); ++row) {
    SmallVector z(size), y(size);
    for (int j = 0; j < size; ++j) {
      const int k = pair.columns[at(j)];
      z[j] = basis.Z(row, k);
      y[j] = k < basis.modes ? basis.Y(k, row) : -basis.Y(k, row);
    }
    const SmallVector right = best.X.transpose() * z, left = best.inverse * y;
    for (int j = 0; j < size; ++j) {
      const int k = pair.columns[at(j)];
      basis.Z(row, k) = right[j];
      basis.Y(k, row) = k < basis.modes ? left[j] : -left[j];
    }
  }
  return true;
}

}  // namespace dashpot::analysis
