#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/controller/config.hpp>

#include <vector>

namespace dashpot::apps {

/// Returns the robot of a configuration with all that a check determined: rotors, friction,
/// payload, gravity.
controller::RobotDescription calibrated_robot(const controller::Config& config,
                                              const identification::ModelCheck& check);

/// Returns the sampled loop that the configuration's gains make with this robot at the posture `q`,
/// with the longer of the determined delay and the configuration's. Rotors and viscous friction
/// that neither the records determine nor the configuration has are as the records have them. The
/// covariance of the modes is J P J', with J = d modes / d parameters, by differences, and P the
/// covariance of the parameters; a mode has infinite deviations if it depends on a rotor or viscous
/// friction of which the records know nothing.
CalibratedLoop calibrated_loop(const controller::Config& config,
                               const identification::ModelCheck& check,
                               const controller::JointVector& q);

}  // namespace dashpot::apps
