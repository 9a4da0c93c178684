#pragma once
#include <dashpot/apps/identify/identify_writer.hpp>

#include <vector>

namespace dashpot::apps {

/// Matches each prediction with a measured mode: the nearest in frequency, ratio and shape
/// (nearest_pairs).
void match(const std::vector<identification::MeasuredMode>& measured,
           std::vector<PredictedMode>& predicted);

/// Puts modes into the order of equally many others with similar shapes, because the order by
/// frequency changes with an arm's parameters. Does nothing if the numbers differ.
void put_in_order(const std::vector<PredictedMode>& others, std::vector<PredictedMode>& modes);

}  // namespace dashpot::apps
