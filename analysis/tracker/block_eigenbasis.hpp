#pragma once
#include <dashpot/analysis/linalg/block_sylvester.hpp>
#include <dashpot/analysis/linalg/packed_matrix.hpp>
#include <dashpot/analysis/system.hpp>
#include <dashpot/analysis/work.hpp>

namespace dashpot::analysis {

/// A symmetric system as a pair of symmetric matrices in state space. With a stiffness factor W
/// (p x n, p <= n, K = W'W) the states are the elastic coordinates s = W q and the velocities v,
///
///     S x' = B x,    S = [I 0; 0 -M],    B = [0 W; W' C],    x = (s, v),
///
/// which has 2p + (n - p) eigenvalues: the eigenvalues of the p modes, and the rates of n - p zero
/// modes' velocities. No rank is decided and nothing is squared. Without a factor (p = n) the
/// states are (q, v), S = [K 0; 0 -M] and B = [0 K; K C], for a positive definite K.
///
/// The matrices belong to the caller and are not copied. M, C and K are symmetric; where C or K is
/// not, or K is singular and has no factor, the basis is two-sided. Without a factor S and B then
/// are S = [I 0; 0 -M] and B = [0 I; K C].
struct SymmetricPencil {
  int joints = 0;  ///< n
  int rank = 0;    ///< p
  bool factored = false;
  const double* M = nullptr;  ///< n x n
  const double* C = nullptr;  ///< n x n
  const double* W = nullptr;  ///< p x n; K (n x n) if not factored

  int states() const { return rank + joints; }
  int zeros() const { return joints - rank; }  ///< zero modes, without those that soft modes become
};
SymmetricPencil symmetric_pencil(const System<kMaxDof>& system) noexcept;

/// Steps this small leave eigenvectors right to their square once they are taken.
inline constexpr double kLastStep = 1e-7;
/// Below this, nothing but rounding errors is left to improve.
inline constexpr double kConverged = 1e-9;

/// A basis Z of the pencil's state space (all its columns), nearly orthonormal in the indefinite
/// metric S,
///
///     Z' S Z = Sigma = diag(I, -I, -I),     columns [first of each mode | second | zero modes],
///
/// in which the system is nearly block diagonal, with one real 2 x 2 block for each mode and one
/// rate for each zero mode: S^-1 B Z = Z Lambda. A block has a complex pair or two real eigenvalues
/// of opposite sign characteristic. It stays well conditioned where the two meet (critical
/// damping). The left vectors are S Z. S has as many negative squares as Sigma, so that with a
/// factor a basis with a proved bound proves M positive definite.
///
/// If the left vectors do not follow from the right ones, the basis has two sides, with the left
/// vectors in the rows of Y:
///
///     Y S Z = Sigma nearly,     S^-1 B Z = Z Lambda,     Y B S^-1 = Sigma Lambda Sigma Y.
///
/// Sigma does not express sign types there: the sign of a left vector is free. With these signs the
/// results of Y S Z and Y B Z are computed as for a symmetric system, where Y = Z'. The two
/// eigenvalues of a block are any two. There are as many blocks as joints without a factor; zero
/// modes are the last of them then, with an eigenvalue of zero to rounding.
struct BlockEigenbasis {
  using Entries = std::array<double, 20>;  ///< of up to 16 modes, read in fours
  int modes = 0;                           ///< p
  int zeros = 0;                           ///< n - p
  PackedMatrix Z;  ///< n + p rows and columns: elastic coordinates, then velocities
  bool two_sided = false;
  int still = 0;  ///< of `modes`: blocks that are zero modes all the same, the last ones; two-sided
                  ///< bases without a factor have them
  double still_floor = 0;  ///< frequency below which blocks became zero modes, rad/s
  PackedMatrix Y;          ///< of the size of Z, if two_sided
  /// Lambda of mode i is [l00 l01; l10 l11](i), 1/s.
  Entries l00{}, l01{}, l10{}, l11{};
  Entries rate{};  ///< of the zero modes, 1/s

  int columns() const { return 2 * modes + zeros; }
  int blocks() const { return modes + zeros; }
  /// A step this small leaves nothing but rounding errors to improve. Of two sides these are the
  /// greater part of a bound before.
  double converged() const { return two_sided ? kLastStep : kConverged; }
  int vibrations() const { return modes - still; }  ///< modes that are published as such
  /// Columns of block i: a mode's first and second, or the one column of a zero mode twice.
  int first(int i) const { return i < modes ? i : modes + i; }
  int second(int i) const { return modes + i; }
  /// Block of mode i, and of modes i to i + 3.
  Block2<double> block(int i) const {
    const auto k = static_cast<std::size_t>(i);
    return {l00[k], l01[k], l10[k], l11[k]};
  }
  Block2<Vec4d> blocks_from(int i) const {
    const auto k = static_cast<std::size_t>(i);
    return {load(&l00[k]), load(&l01[k]), load(&l10[k]), load(&l11[k])};
  }
};

/// The residual of a basis: S^-1 B Z = Z (Lambda + F) exactly, with
///     N F = G,     N = Z' S Z,     G = Z' B Z - N Lambda,
/// and Y in the place of Z' where the basis is two-sided.
struct TrackedResidual {
  PackedMatrix R;  ///< N - Sigma
  PackedMatrix G;  ///< without the diagonal blocks of modes, 1/s
  BlockEigenbasis::Entries
      diagonal{};      ///< squared Frobenius norms of these blocks, 1/s^2: rounding errors
  PackedMatrix MV;     ///< -M V for the velocity rows V of Z, n rows, below the other rows of S Z
  PackedMatrix image;  ///< B Z
};

/// Sets the blocks of Lambda to N_ii^-1 (Z' B Z)_ii, and then evaluates the residual.
void evaluate(const SymmetricPencil& pencil, BlockEigenbasis& basis,
              TrackedResidual& residual) noexcept;

/// Two blocks that a Newton step cannot tell apart.
struct CloseBlocks {
  int first = -1, second = -1;
  explicit operator bool() const { return first >= 0; }
};

/// Computes Newton's step Z <- Z (I + E) on the whole basis:
/// Lambda_i E_ij - E_ij Lambda_j = -Sigma_i G_ij off the diagonal. On the diagonal, and where F_ij
/// and the differences of the eigenvalues are below `roundoff_bound` (1/s), E makes Z orthonormal
/// again. Modes that coincide as far as the rest of the step lets one see are only parted across
/// (an eigenvalue of one from the other one's conjugate, or from its other real one): no direction
/// tells them apart, and what couples them goes away with the square of the step. Returns the two
/// blocks that are hardest to separate, if there are other pairs whose E is not small; E is left
/// out for all such pairs. `size` is the Frobenius norm of E. (Dongarra, Moler, Wilkinson 1983;
/// Davies, Modi 1986; Ogita, Aishima 2018.)
CloseBlocks newton_step(const BlockEigenbasis& basis, const TrackedResidual& residual,
                        double roundoff_bound, PackedMatrix& E, double& size) noexcept;

/// Separates two blocks that Newton's method cannot tell apart, by dividing the space of their
/// columns into two invariant planes again (a plane and a line with a zero mode, lines of two).
/// In the division that is chosen, each new block has most of the old one whose index it gets. In
/// a basis of one side the blocks are orthonormal, and of real eigenvalues the two of opposite sign
/// characteristic that are nearest each other share a block, because only such a pair can meet and
/// turn complex. Zero modes of such a basis are separated all at once.
///
/// `residual` belongs to the basis, at least nearly. Returns false, and does not change the basis,
/// where no well-conditioned columns separate the blocks: a defective eigenvalue of two modes.
bool separate_blocks(const TrackedResidual& residual, const CloseBlocks& close,
                     BlockEigenbasis& basis) noexcept;

/// Computes Z <- Z (I + E). The other side becomes Y <- Sigma (I - Sigma R - E) Sigma Y: Y S Z =
/// Sigma then holds to second order. That overwrites MV and image of the residual.
void take_step(const PackedMatrix& E, TrackedResidual& residual, BlockEigenbasis& basis) noexcept;

/// Keeps the columns of each block well conditioned, before or after a step: rotates or balances
/// blocks whose columns lean far towards each other, or differ much in length. The residual belongs
/// to this basis, at least nearly.
void recondition(const SymmetricPencil& pencil, const TrackedResidual& residual,
                 BlockEigenbasis& basis) noexcept;

/// Rotates each block of a basis of one side hyperbolically so that its two columns become
/// orthogonal in the energy metric diag(I, M) as well, which keeps the basis as well conditioned as
/// it can be. Blocks that are orthogonal to `tolerance` already are left alone. Returns true if any
/// block was rotated.
bool rotate_hyperbolically(const TrackedResidual& residual, double tolerance,
                           BlockEigenbasis& basis) noexcept;

/// Makes the two columns of each block of a two-sided basis orthonormal in the energy
/// diag(w^2 D, D), D the diagonal of M, w the natural frequency of the block, or diag(I, D) with a
/// factor; and its rows of Y dual to them. Blocks whose columns have lengths within a factor of
/// three of each other and do not lean towards each other are left alone, unless `all`. Returns
/// true if any block was changed.
bool balance(const SymmetricPencil& pencil, bool all, BlockEigenbasis& basis) noexcept;

/// Returns the work of evaluating a basis, and of the step that follows.
std::int64_t iteration_work(const BlockEigenbasis& basis) noexcept;

/// Returns the width of the rows of a basis: its columns, and room for entries that groups of four
/// modes write beyond them.
int packed_width(int modes, int zeros) noexcept;

}  // namespace dashpot::analysis
