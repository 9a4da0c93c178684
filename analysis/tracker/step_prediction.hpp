#pragma once
#include <dashpot/analysis/linalg/packed_matrix.hpp>

namespace dashpot::analysis {

/// Extrapolates the step by which a basis changes from one update to the next, from the last three
/// steps. Of the polynomials of degree 0, 1 and 2 it uses the one that would have predicted the
/// last step best. It predicts no step if none of them would have predicted it well.
class StepPrediction {
 public:
  /// True if next() holds a prediction: E of Z <- Z (I + E).
  bool ready() const noexcept { return ready_; }
  const PackedMatrix& next() const noexcept { return next_; }

  /// Learns the whole step of an update, which has this many rows.
  void learn(const PackedMatrix& step, int rows) noexcept;
  /// Forgets the last steps, which tell nothing of the next one because the columns have been
  /// rotated.
  void forget(int width, int rows) noexcept;
  /// Predicts nothing until the next step is learnt.
  void pause() noexcept { ready_ = false; }

 private:
  PackedMatrix step_, change_, curve_;  ///< the last step, and its differences from earlier steps
  PackedMatrix next_;
  bool ready_ = false;
};

}  // namespace dashpot::analysis
