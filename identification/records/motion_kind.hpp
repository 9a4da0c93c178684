#pragma once
#include <dashpot/identification/motion_record.hpp>

namespace dashpot::identification {

/// Median frequency of the channels' velocities beyond noise, by their squares, rad/s. It is the
/// unit of frequency of all searches in a record. 0 if nothing moves. `grid` is channels x samples,
/// `step` (s) apart.
double pace_of(const Eigen::MatrixXd& grid, double step, const Eigen::VectorXd& noise);

}  // namespace dashpot::identification
