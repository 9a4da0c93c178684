#pragma once
#include <dashpot/analysis/linalg/packed_matrix.hpp>

namespace dashpot::analysis {

/// Foresees the step by which a basis changes from one update to the next, from its last three: by
/// that polynomial which would have foreseen the last one best, of degree 2, 1, 0, or no step at
/// all.
class StepPrediction {
 public:
  /// What is expected next, if anything: E of Z <- Z (I + E).
  bool ready() const noexcept { return ready_; }
  const PackedMatrix& next() const noexcept { return next_; }

  /// Of an update's whole step, with this many rows.
  void learn(const PackedMatrix& step, int rows) noexcept;
  /// The last steps tell nothing of the next one: the columns have turned.
  void forget(int width, int rows) noexcept;
  /// Expects nothing until something is learnt.
  void pause() noexcept { ready_ = false; }

 private:
  PackedMatrix step_, change_, curve_;  ///< the last step, and its differences from those before
  PackedMatrix next_;
  bool ready_ = false;
};

}  // namespace dashpot::analysis
