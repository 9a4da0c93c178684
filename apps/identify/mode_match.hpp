#pragma once
#include <dashpot/apps/identify/identify_writer.hpp>

#include <vector>

namespace dashpot::apps {

/// Gives each prediction the measured mode that it is: the nearest in frequency, ratio and shape
/// (nearest_pairs).
void match(const std::vector<identification::MeasuredMode>& measured,
           std::vector<PredictedMode>& predicted);

/// Puts modes into the order of as many others that are alike in shape: their order by frequency
/// changes with an arm's parameters. Other numbers of modes stay as they are.
void put_in_order(const std::vector<PredictedMode>& others, std::vector<PredictedMode>& modes);

}  // namespace dashpot::apps
