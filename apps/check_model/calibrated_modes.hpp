#pragma once
#include <dashpot/apps/check_model/check_model_report.hpp>
#include <dashpot/controller/config.hpp>

#include <vector>

namespace dashpot::apps {

/// Returns the robot of a configuration with all that a check determined of it: rotors, friction,
/// payload, gravity.
controller::RobotDescription calibrated_robot(const controller::Config& config,
                                              const identification::ModelCheck& check);

/// Returns the modes of the sampled loop that the configuration's gains make with this robot at the
/// posture `q`. With J, how they change with the parameters, by differences, and P, the parameters'
/// covariance, theirs is J P J'.
std::vector<CalibratedMode> calibrated_modes(const controller::Config& config,
                                             const identification::ModelCheck& check,
                                             const controller::JointVector& q);

}  // namespace dashpot::apps
