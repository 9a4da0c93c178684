#pragma once
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/decay_fit.hpp>
#include <dashpot/identification/model/excited_cells.hpp>
#include <dashpot/identification/model/realization.hpp>

#include <array>
#include <optional>
#include <vector>

namespace dashpot::identification {

/// The model that records support, and what was learnt on the way to it.
struct FoundModel {
  DecayData data;                                   ///< that it is fitted to
  DecayFit fit = {};                                ///< the model
  std::vector<std::vector<RealizedPole>> by_order;  ///< from order 1
  int order = 0;                                    ///< of the realization chosen
  std::optional<DecayFit> larger = {};              ///< the best that was not worth it
  /// Variance of each factor's `first` and `second` that parts of the records show beyond what
  /// each part's own deviations explain.
  std::vector<std::array<double, 2>> scatter = {};
  bool differs = false;  ///< parts of the records differ by more than their deviations
  std::vector<DecayFactor> not_repeated = {};  ///< found in the whole, but not in each part
};

/// Searches for the model of decays, in cells, which are few, and refines it on the samples as they
/// are; without `refine` it is the one of the cells, a first estimate.
FoundModel find_model(const std::vector<MotionRecord>& all, const IdentifyOptions& options);

/// Searches for the model of records with inputs; the cells are fine enough to stand for all
/// samples.
FoundModel find_model(const ExcitedCells& cells, const IdentifyOptions& options);

/// Refines the model that was found in the beginnings of records on all of them.
void refine(const ExcitedCells& all, FoundModel& model);

}  // namespace dashpot::identification
