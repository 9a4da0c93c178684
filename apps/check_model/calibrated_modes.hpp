#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/controller/config.hpp>

#include <vector>

namespace dashpot::apps {

/// Returns the robot of a configuration with all that a check determined of it: rotors, friction,
/// payload, gravity.
controller::RobotDescription calibrated_robot(const controller::Config& config,
                                              const identification::ModelCheck& check);

/// Returns the sampled loop that the configuration's gains make with this robot at the posture `q`,
/// with the determined delay where that is longer than the configuration's. With J, how the modes
/// change with the parameters, by differences, and P, the parameters' covariance, theirs is J P J'.
CalibratedLoop calibrated_loop(const controller::Config& config,
                               const identification::ModelCheck& check,
                               const controller::JointVector& q);

}  // namespace dashpot::apps
