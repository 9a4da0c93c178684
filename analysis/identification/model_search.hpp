#pragma once
#include <dashpot/analysis/identification/decay_cells.hpp>
#include <dashpot/analysis/identification/decay_fit.hpp>
#include <dashpot/analysis/identification/realization.hpp>

#include <optional>
#include <vector>

namespace dashpot::analysis {

/// The search for the model that records support: in cells, which are few, and then refined on the
/// samples as they are.
class ModelSearch {
 public:
  /// See IdentifyOptions.
  ModelSearch(const std::vector<MotionRecord>& records, int max_order, bool refine);

  DecayFit fit;                                     ///< of the samples as they are
  std::vector<std::vector<RealizedPole>> by_order;  ///< from order 1
  int order = 0;                                    ///< of the realization chosen
  std::optional<DecayFit> larger;                   ///< the best that was not worth it
  DecayData data;

 private:
  void choose_order(const DecayCells& cells);
  std::vector<DecayFactor> candidates(const DecayCells& cells) const;
  bool add_from_rest(const DecayCells& cells);
  bool drop_one();
  void untangle(const DecayCells& cells);
  bool change(const std::vector<DecayFactor>& factors);
};

}  // namespace dashpot::analysis
