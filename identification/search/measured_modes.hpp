#pragma once
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/search/doubts.hpp>

#include <vector>

namespace dashpot::identification {

/// A removed hum, as a mode that is not believed.
MeasuredMode to_mode(const SteadyLine& hum);

/// The eigenvalues of models of rising order, from order 1, and whether each is stable.
std::vector<ModelPole> model_poles(const std::vector<std::vector<RealizedPole>>& by_order);

/// The share of the models of `order` eigenvalues and more that have this mode.
double stability_of(const MeasuredMode& mode,
                    const std::vector<std::vector<RealizedPole>>& by_order, int order);

/// Makes overdamped modes of single eigenvalues of like shapes, and rejects doubtful modes
/// (doubts.hpp); modes that already have a reason are rejected too.
void judge(std::vector<MeasuredMode> modes, const RecordFacts& records, Identification& result);

}  // namespace dashpot::identification
