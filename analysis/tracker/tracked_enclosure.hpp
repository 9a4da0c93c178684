#pragma once
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Bounds of the rounding errors of the residual of a basis. With vectors of one entry for each row
/// of Y or column of Z, and a factor gamma, entrywise
///
///     |N error| <= gamma (a z' + |M| p e'),
///     |T error| <= gamma (a x' + b f' + |C| p e').
///
/// Let s_k = sqrt(M_kk), |M|, |C| and |K| the largest |M_ij| / (s_i s_j), and so on, and t_k the
/// size of column k of W. A column has z of its positions, e = s' |v| of its velocities, and x of
/// their elastic rates.
///
/// One side, Y = Z': t_k is a length, a = z is the length of the elastic coordinates, or without a
/// factor sqrt(|K|) s' |q|; b = x = t' |v|, or sqrt(|K|) e; f = a and p = e.
///
/// Two sides: t_k is a sum, a row (y_q, y_v) has p = s' |y_v|. Without a factor a = max |y_q| / s
/// and b = p, z = s' |q|, x = e and f = |K| z. With one a = max |y_s| and b = t' |y_v|, and a
/// column has the sum z = f of |s|, and x = t' |v|.
///
/// The vectors are kept for each block.
class ResidualErrors {
 public:
  ResidualErrors(const SymmetricPencil& pencil, const BlockEigenbasis& basis) noexcept;

  /// False if masses or rates are too large or too small for products not to leave the range.
  bool in_range() const { return in_range_; }
  /// Bounds of the errors of blocks (i, j) to (i, j + 3) of G = T - N Lambda.
  Vec4d of_G(int i, int j) const {
    const auto k = static_cast<std::size_t>(i);
    return gamma_ * (a_[k] * four(x_, j) + b_[k] * four(f_, j) + p_[k] * four(m_, j));
  }
  /// Error of block columns j to j + 3 of G.
  Vec4d of_columns(int j) const {
    return gamma_ * (all_a_ * four(x_, j) + all_b_ * four(f_, j) + all_p_ * four(m_, j));
  }
  /// Errors of all of G, of block row i of N, and of all of N.
  double of_G() const { return gamma_ * (all_a_ * all_x_ + all_b_ * all_f_ + all_p_ * all_m_); }
  double of_N(int i) const {
    const auto k = static_cast<std::size_t>(i);
    return gamma_ * (a_[k] * all_z_ + p_[k] * all_momenta_);
  }
  double of_N() const { return gamma_ * (all_a_ * all_z_ + all_p_ * all_momenta_); }

 private:
  using Blocks = BlockEigenbasis::Entries;
  static Vec4d four(const Blocks& x, int j) { return load(&x[static_cast<std::size_t>(j)]); }

  double gamma_;
  bool in_range_ = false;
  Blocks a_, b_, p_;  ///< of rows
  /// For each column: x + z |Lambda|, f, and (|C| + |M| |Lambda|) e.
  Blocks x_{}, f_, m_;
  double all_a_ = 0, all_b_ = 0, all_p_ = 0, all_x_ = 0, all_f_ = 0, all_m_ = 0, all_z_ = 0,
         all_momenta_ = 0;  ///< of all rows or columns; the last one is of |M| e
};

/// The proved bounds of the blocks of a basis.
struct TrackedEnclosure : BlockEnclosure<kMaxDof> {
  /// Bound of the rounding errors of all of G (Frobenius norm), 1/s: smaller couplings say nothing.
  double roundoff_bound = 0;
};

/// Computes bounds by Stewart's theorem (see enclosure.hpp) in the metric of the basis. The bounds
/// include the rounding errors of `residual`.
void enclose(const SymmetricPencil& pencil, const BlockEigenbasis& basis,
             const TrackedResidual& residual, TrackedEnclosure& enclosure) noexcept;

}  // namespace dashpot::analysis
