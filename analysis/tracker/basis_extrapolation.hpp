#pragma once
#include <dashpot/analysis/linalg/packed_matrix.hpp>

namespace dashpot::analysis {

/// Extrapolates a basis that changes smoothly from one update to the next, from its last four. Of
/// the polynomials of degree 0 to 3 it uses the one that would have predicted the last basis best.
class BasisExtrapolation {
 public:
  /// Learns Z, which has this many rows, and replaces it by a prediction of the next one.
  void apply(int rows, PackedMatrix& Z) noexcept;
  /// Returns what was learnt last.
  const PackedMatrix& last() const noexcept { return last_; }
  /// Forgets the past, because the next basis will not continue it smoothly.
  void forget() noexcept { begun_ = false; }

 private:
  bool begun_ = false;
  PackedMatrix last_, step_, change_, curve_;  ///< the last basis, and its differences
};

}  // namespace dashpot::analysis
