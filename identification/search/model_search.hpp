#pragma once
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/excited_cells.hpp>
#include <dashpot/identification/search/found_model.hpp>

#include <vector>

namespace dashpot::identification {

/// Searches for the model of decays, in cells, which are few, and refines it on the samples as they
/// are; without `refine` it is the one of the cells, a first estimate.
FoundModel find_model(const std::vector<MotionRecord>& all, const IdentifyOptions& options);

/// Searches for the model of records with inputs; the cells are fine enough to stand for all
/// samples.
FoundModel find_model(const ExcitedCells& cells, const IdentifyOptions& options);

/// Refines the model that was found in the beginnings of records on all of them.
void refine(const ExcitedCells& all, FoundModel& found);

}  // namespace dashpot::identification
