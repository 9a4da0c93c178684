#pragma once
#include <dashpot/apps/identify/loop_prediction.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

/// Finds the change of the parameters `names` ("payload,reflected_inertia,friction,delay") that
/// explains the differences best: least squares of the measured numbers at all postures, each in
/// units of its deviation, with Huber's weights and within bounds (mass, inertia, friction and
/// delay are not negative, and a body can have the payload's inertia). Updates the predictions.
/// Throws InputError for other names.
Calibration calibrate(const LoopPrediction& loop, const std::string& names,
                      std::vector<PostureReport>& postures);

}  // namespace dashpot::apps
