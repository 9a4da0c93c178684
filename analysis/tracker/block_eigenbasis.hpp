#pragma once
#include <dashpot/analysis/linalg/packed_matrix.hpp>
#include <dashpot/analysis/system.hpp>

namespace dashpot::analysis {

/// A symmetric system in a state space where it is a pair of symmetric matrices: with a stiffness
/// factor W (p x n, p <= n, K = W'W) the states are the elastic coordinates s = W q and the
/// velocities v,
///
///     S x' = B x,    S = [I 0; 0 -M],    B = [0 W; W' C],    x = (s, v),
///
/// which has 2p + (n - p) eigenvalues: those of the p modes, and the rates of n - p zero modes'
/// velocities. No rank is decided and nothing is squared. Without a factor (p = n) the states are
/// (q, v), S = [K 0; 0 -M] and B = [0 K; K C], for a positive definite K.
///
/// The matrices are those of the caller, not copies; M, C and K are symmetric.
struct SymmetricPencil {
  int joints = 0;  ///< n
  int rank = 0;    ///< p
  bool factored = false;
  const double* M = nullptr;  ///< n x n
  const double* C = nullptr;  ///< n x n
  const double* W = nullptr;  ///< p x n; K (n x n) if not factored

  int states() const { return rank + joints; }
  int zeros() const { return joints - rank; }  ///< zero modes, those that soft modes become apart
};
SymmetricPencil symmetric_pencil(const System<kMaxDof>& system) noexcept;

/// A basis Z of that space (all its columns), nearly orthonormal in the indefinite metric S,
///
///     Z' S Z = Sigma = diag(I, -I, -I),     columns [first of each mode | second | zero modes],
///
/// in which the system nearly falls apart into one real 2 x 2 block a mode and one rate a zero
/// mode: S^-1 B Z = Z Lambda. A block has a complex pair or two real eigenvalues of opposite sign
/// type, and stays well conditioned where the two meet (critical damping). Left vectors are S Z. S
/// has as many negative squares as Sigma: with a factor, a certified basis proves M positive
/// definite.
struct BlockEigenbasis {
  using Entries = std::array<double, 20>;  ///< of up to 16 modes, read in fours
  int modes = 0;                           ///< p
  int zeros = 0;                           ///< n - p
  PackedMatrix Z;  ///< n + p rows and columns: elastic coordinates, then velocities
  /// The undamped modes decouple the damping: first columns are elastic coordinates alone, all
  /// others velocities alone, to the last bit, and so they stay.
  bool proportional = false;
  /// Lambda of mode i is [l00 l01; l10 l11](i), 1/s.
  Entries l00{}, l01{}, l10{}, l11{};
  Entries rate{};  ///< of the zero modes, 1/s

  int columns() const { return 2 * modes + zeros; }
  int blocks() const { return modes + zeros; }
  /// Columns of block i: a mode's first and second, or twice the one of a zero mode.
  int first(int i) const { return i < modes ? i : modes + i; }
  int second(int i) const { return modes + i; }
};

/// What a basis lacks: exactly S^-1 B Z = Z (Lambda + F) with
///     N F = G,     N = Z' S Z,     G = Z' B Z - N Lambda.
struct TrackedResidual {
  PackedMatrix R;  ///< N - Sigma
  PackedMatrix G;  ///< without the diagonal blocks of modes, 1/s
  BlockEigenbasis::Entries
      diagonal{};      ///< squared Frobenius norms of those, 1/s^2: rounding errors
  PackedMatrix MV;     ///< -M V for the velocity rows V of Z, n rows: below the rows of S Z
  PackedMatrix image;  ///< B Z
};

/// Evaluates the residual, after setting the blocks of Lambda to N_ii^-1 (Z' B Z)_ii. Of a
/// proportional basis Z = [Z_s 0; 0 V], only W V and C V and what they become in Z_s and V are
/// computed.
void evaluate(const SymmetricPencil& pencil, BlockEigenbasis& basis,
              TrackedResidual& residual) noexcept;

/// Two blocks that a Newton step cannot tell apart.
struct CloseBlocks {
  int first = -1, second = -1;
  explicit operator bool() const { return first >= 0; }
};

/// Newton's step Z <- Z (I + E) on the whole basis: Lambda_i E_ij - E_ij Lambda_j = -Sigma_i G_ij
/// off the diagonal, and what makes Z orthonormal again on it and where F_ij is below
/// `roundoff_bound` (1/s) and so are the eigenvalues' differences. Returns the two blocks that are
/// hardest to part, if there are any whose E is not small; then their E is left out. (Dongarra,
/// Moler, Wilkinson 1983; Davies, Modi 1986; Ogita, Aishima 2018.) `size` is the Frobenius norm of
/// E.
CloseBlocks newton_step(const BlockEigenbasis& basis, const TrackedResidual& residual,
                        double roundoff_bound, PackedMatrix& E, double& size) noexcept;

/// What a step E mixes of elastic coordinates into velocities, and the other way: the Frobenius
/// norm of its (or of Z's) entries between first columns and others.
double coupling_norm(const BlockEigenbasis& basis, const PackedMatrix& E) noexcept;

/// Z <- Z (I + E); a proportional basis stays one, and takes no part of the coupling_norm in E.
void take_step(const PackedMatrix& E, BlockEigenbasis& basis) noexcept;

/// The velocity rows (n) of Z (I + E).
void stepped_velocities(const BlockEigenbasis& basis, const PackedMatrix& E,
                        PackedMatrix& out) noexcept;

/// Width of the rows of a basis: its columns, and room for what fours of modes write too far.
int packed_width(int modes, int zeros) noexcept;

}  // namespace dashpot::analysis
