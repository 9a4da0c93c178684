#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <cstdint>

namespace dashpot::analysis {

/// Keeps what stays with a mode along a path: its index, and whether it was soft.
struct ModeLabels {
  /// Grows when modes cannot be matched to earlier ones, and indices are new.
  std::uint64_t epoch = 0;
  std::array<bool, kMaxDof> soft{};  ///< of each index

  /// Gives the modes of `basis` the indices of the modes of `before` that they resemble, or, if
  /// there are none or another number of them, new ones. Returns the index that each mode gets.
  std::array<int, kMaxDof> match(const System<kMaxDof>& system, bool symmetric, bool any_before,
                                 const BlockEigenbasis& before, BlockEigenbasis& basis) noexcept;
};

/// Makes the columns of `basis` span the planes of the modes of `spectrum`. Such a basis serves
/// only for matching later modes, not as a start for Newton's method.
void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                BlockEigenbasis& basis) noexcept;

/// Extrapolates a basis that changes smoothly from one update to the next, from its last four. Of
/// the polynomials of degree 0 to 3 it uses the one that would have predicted the last basis best.
class BasisExtrapolation {
 public:
  /// Learns the basis, each side by itself, and replaces it by a prediction of the next one.
  void apply(BlockEigenbasis& basis) noexcept;
  /// Replaces the basis by what was learnt last, and forgets the past.
  void go_back(BlockEigenbasis& basis) noexcept;
  /// Forgets the past, because the next basis will not continue it smoothly.
  void forget() noexcept { right_.forget(), left_.forget(); }

 private:
  class Side {
   public:
    void apply(int rows, PackedMatrix& Z) noexcept;
    void forget() noexcept { begun_ = false; }
    const PackedMatrix& last() const noexcept { return last_; }

   private:
    bool begun_ = false;
    PackedMatrix last_, step_, change_, curve_;  ///< the last basis, and its differences
  };

  Side right_, left_;
};

}  // namespace dashpot::analysis
