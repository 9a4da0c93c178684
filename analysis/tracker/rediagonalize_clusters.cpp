#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/invariant_subspaces.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

/// Squared lengths in the metric below this, relative to Euclidean ones, count as zero.
constexpr double kNeutralLength = 1e-4;
/// Columns whose inverse is larger than this separate nothing.
constexpr double kIllConditioned = 1e5;
/// Couplings that a division may leave, relative to the whole: Newton's method removes them.
constexpr double kCoupled = 1e-2;

/// At most 4 x 4
using Small = State<kMaxDof>;
using SmallVector = StateVector<kMaxDof>;

/// Two blocks: their columns with the products N, and how the system acts on them, A = N^-1 T.
struct BlockPair {
  std::array<int, 4> columns{};
  int size = 0, split = 0;  ///< columns of both, and of the first
  bool two_sided = false;
  Small N, A;
  std::array<Complex, 4> values{};

  Complex value(int i) const { return values[at(i)]; }
  bool any_complex() const {
    bool any = false;
    for (int i = 0; i < size; ++i) any |= value(i).imag() != 0;
    return any;
  }
};

bool pose(const TrackedResidual& residual, const CloseBlocks& close, const BlockEigenbasis& basis,
          BlockPair& pair) {
  const int m = basis.modes;
  pair.two_sided = basis.two_sided;
  Small Lambda = Small::Zero(4, 4);
  for (const int block : {close.first, close.second}) {
    const int first = pair.split = pair.size;
    pair.columns[at(pair.size++)] = basis.first(block);
    if (block < m) {
      const Block2<double> L = basis.block(block);
      pair.columns[at(pair.size++)] = basis.second(block);
      Lambda.block(first, first, 2, 2) << L.a, L.b, L.c, L.d;
    } else {
      Lambda(first, first) = basis.rate[at(block - m)];
    }
  }
  pair.N.resize(pair.size, pair.size);
  pair.A.resize(pair.size, pair.size);
  for (int i = 0; i < pair.size; ++i) {
    for (int j = 0; j < pair.size; ++j) {
      const int row = pair.columns[at(i)], column = pair.columns[at(j)];
      pair.N(i, j) = residual.R(row, column) + (row != column ? 0.0 : row < m ? 1.0 : -1.0);
      pair.A(i, j) = residual.G(row, column);
    }
  }
  Small N = pair.N;
  solve_in_place(N, pair.A, std::numeric_limits<double>::min());
  pair.A += Lambda.topLeftCorner(pair.size, pair.size);
  if (!pair.A.allFinite()) return false;
  Small H = pair.A;
  reduce_to_hessenberg(H);
  return hessenberg_eigenvalues(H, pair.values.data());
}

/// The invariant plane or line of the eigenvalues in `set`.
Small space(const BlockPair& pair, unsigned set) {
  constexpr int kSteps = 3;
  std::array<Complex, 2> wanted;
  int count = 0;
  for (int i = 0; i < pair.size; ++i) {
    if ((set >> i & 1) != 0) wanted[at(count++)] = pair.value(i);
  }
  const auto& [x, y] = wanted;
  Work work;  // its caller has counted it
  return invariant_subspace<kMaxDof>(pair.A, x, count == 1 || x.imag() != 0 ? x : y, count, kSteps,
                                     work);
}

/// Whether conjugates go together.
bool is_closed(const BlockPair& pair, unsigned set) {
  for (int i = 0; i < pair.size; ++i) {
    for (int j = 0; j < pair.size; ++j) {
      const bool conjugate = pair.value(i).imag() != 0 && pair.value(j) == std::conj(pair.value(i));
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
  orthonormalize(both);
  return both;
}

/// Distance of the two nearest real eigenvalues that share a block: of opposite sign
/// characteristic, these may meet and turn complex.
double nearest_pair(const BlockPair& pair, unsigned set) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < pair.size; ++i) {
    for (int j = 0; j < i; ++j) {
      if ((set >> i & 1) != (set >> j & 1)) continue;
      nearest = std::min(nearest, modulus(pair.value(i) - pair.value(j)));
    }
  }
  return nearest;
}

/// Makes the columns orthonormal in the metric N, with one of either sign type in a plane, and of
/// type - alone; false if they are not of these.
bool orthonormalize_in(const Small& N, Small& columns) {
  const Small gram = columns.transpose() * N * columns;
  const Eigen::SelfAdjointEigenSolver<Small> eigen(gram);
  const auto& lengths = eigen.eigenvalues();
  const Eigen::Index last = lengths.size() - 1;
  if (!(lengths[0] < -kNeutralLength)) return false;
  const SmallVector minus = columns * eigen.eigenvectors().col(0) / std::sqrt(-lengths[0]);
  if (last > 0) {
    if (!(lengths[last] > kNeutralLength)) return false;
    columns.col(0) = (columns * eigen.eigenvectors().col(last) / std::sqrt(lengths[last])).eval();
  }
  columns.col(last) = minus;
  return true;
}

/// A division into two blocks, and how good it is.
struct Division : Separation<kMaxDof> {
  double gap = 0;     ///< of the pair of real eigenvalues that are to share a block; the least wins
  double share = -1;  ///< of the old blocks that the new ones have; then the most
};

/// Considers the invariant spaces `first` and `second`; on one side, what of `second` is orthogonal
/// to `first`.
void consider(const BlockPair& pair, Small first, Small second, double gap, Division& best) {
  const int size = pair.size, split = pair.split;
  if (!pair.two_sided) {
    if (!orthonormalize_in(pair.N, first)) return;
    Small signed_rows = first.transpose() * pair.N;
    signed_rows.row(split - 1) *= -1;
    second -= first * (signed_rows * second).eval();
    if (!orthonormalize_in(pair.N, second)) return;
  }
  Small X(size, size);
  X << first, second;
  const Separation<kMaxDof> separation(pair.A, X);
  if (!(separation.inverse.norm() < kIllConditioned)) return;
  const double coupling = separation.Lambda.topRightCorner(split, size - split).norm() +
                          separation.Lambda.bottomLeftCorner(size - split, split).norm();
  if (!(coupling <= kCoupled * pair.A.norm())) return;
  const double share = first.topRows(split).squaredNorm() / first.squaredNorm() +
                       second.bottomRows(size - split).squaredNorm() / second.squaredNorm();
  if (best.share < 0 || gap < best.gap || (gap == best.gap && share > best.share)) {
    best = {separation, gap, share};
  }
}

/// Rotates the columns of the zero modes of a basis of one side, all at once, until the damping
/// tells them apart. The columns are orthonormal, or nearly. False if the residual is not finite.
bool separate_zero_modes(const TrackedResidual& residual, BlockEigenbasis& basis) {
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDof, kMaxDof>;
  const int first = 2 * basis.modes, count = basis.zeros;
  Columns T(count, count);  // symmetric but for rounding errors; one triangle is read
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      const double N = residual.R(first + i, first + j) - (i == j ? 1 : 0);
      T(i, j) = residual.G(first + i, first + j) + N * basis.rate[at(j)];
    }
  }
  const Eigen::SelfAdjointEigenSolver<Columns> rates(T);
  if (!rates.eigenvectors().allFinite()) return false;
  for (int row = 0; row < basis.columns(); ++row) {
    Eigen::Map<Vector<kMaxDof>> z(&basis.Z(row, first), count);
    z = (rates.eigenvectors().transpose() * z).eval();
  }
  return true;
}

}  // namespace

bool separate_blocks(const TrackedResidual& residual, const CloseBlocks& close,
                     BlockEigenbasis& basis) noexcept {
  if (close.first >= basis.modes && !basis.two_sided) return separate_zero_modes(residual, basis);
  BlockPair pair;
  if (!pose(residual, close, basis, pair)) return false;
  const int size = pair.size, split = pair.split, rest = size - split;
  const bool by_gap = !pair.two_sided && !pair.any_complex();
  Division best;
  for (unsigned set = 0; set < 1U << size; ++set) {
    if (__builtin_popcount(set) != split || !is_closed(pair, set)) continue;
    consider(pair, space(pair, set), space(pair, ~set), by_gap ? nearest_pair(pair, set) : 0, best);
  }
  if (split == 2 && rest == 2 && (pair.two_sided || best.share < 0)) {
    consider(pair, krylov_plane(pair, 0), krylov_plane(pair, 2), 0, best);
  }
  if (best.share < 0) return false;
  for (int row = 0; row < basis.columns(); ++row) {
    SmallVector z(size), y(size);
    for (int j = 0; j < size; ++j) {
      const int k = pair.columns[at(j)];
      z[j] = basis.Z(row, k);
      y[j] = !basis.two_sided ? 0 : k < basis.modes ? basis.Y(k, row) : -basis.Y(k, row);
    }
    const SmallVector right = best.columns.transpose() * z, left = best.inverse * y;
    for (int j = 0; j < size; ++j) {
      const int k = pair.columns[at(j)];
      basis.Z(row, k) = right[j];
      if (basis.two_sided) basis.Y(k, row) = k < basis.modes ? left[j] : -left[j];
    }
  }
  return true;
}

}  // namespace dashpot::analysis
