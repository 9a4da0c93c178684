#pragma once
#include <dashpot/identification/motion_record.hpp>

namespace dashpot::identification {

/// rad/s: half of what the channels' velocities do beyond noise, by its squares, is slower. It is
/// the unit of frequency of whatever is looked for in a record. 0 if nothing moves. `grid` is
/// channels x samples, `step` (s) apart.
double pace_of(const Eigen::MatrixXd& grid, double step, const Eigen::VectorXd& noise);

}  // namespace dashpot::identification
