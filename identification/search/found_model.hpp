#pragma once
#include <dashpot/identification/model/decay_fit.hpp>
#include <dashpot/identification/model/realization.hpp>

#include <array>
#include <optional>
#include <vector>

namespace dashpot::identification {

/// The model that records support, and the results of the search.
struct FoundModel {
  DecayData data;                                   ///< that it is fitted to
  DecayFit fit = {};                                ///< the model
  std::vector<std::vector<RealizedPole>> by_order;  ///< from order 1
  int order = 0;                                    ///< of the realization chosen
  std::optional<DecayFit> larger = {};              ///< the best that was not worth its parameters
  /// Variance of each factor's `first` and `second` that parts of the records show beyond what
  /// each part's own deviations explain.
  std::vector<std::array<double, 2>> scatter = {};
  bool differs = false;  ///< parts of the records differ by more than their deviations
  std::vector<DecayFactor> not_repeated = {};  ///< found in the whole, but not in each part
};

}  // namespace dashpot::identification
