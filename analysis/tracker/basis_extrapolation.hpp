#pragma once
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

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
