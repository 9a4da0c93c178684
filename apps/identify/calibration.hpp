#pragma once
#include <dashpot/apps/identify/loop_prediction.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

/// Which change of the parameters called `names` ("payload,reflected_inertia,friction,delay")
/// explains the differences best: least squares of what was measured at all postures, each number
/// in units of its deviation, with Huber's weights and within bounds (no mass, inertia, friction or
/// delay below zero, and no inertia of a payload that no body has). Updates the predictions. Throws
/// InputError for other names.
Calibration calibrate(const LoopPrediction& loop, const std::string& names,
                      std::vector<PostureReport>& postures);

}  // namespace dashpot::apps
