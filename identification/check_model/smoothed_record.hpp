#pragma once
#include <dashpot/identification/torque_record.hpp>

#include <vector>

namespace dashpot::identification {

/// How records are smoothed: local cubic polynomials over `half_width` to either side.
struct RecordFilter {
  double half_width = 0;       ///< h, s
  double step = 0;             ///< between two values, s
  Eigen::VectorXd rate_noise;  ///< n, standard deviation of the smoothed velocity, rad/s
  double torque_delay = 0;     ///< s by which torques act later than their times say
};

/// A stretch of a record without gaps, smoothed, at evenly spaced times.
struct SmoothRun {
  int record = 0;
  double begin = 0;                            ///< s, of the record's time
  Eigen::MatrixXd position, velocity, torque;  ///< n x N
};

/// Chooses the narrowest smoothing that leaves velocities clear of the positions' noise and
/// quantisation. Throws std::invalid_argument if there are too few samples.
RecordFilter choose_smoothing(const std::vector<TorqueRecord>& records);

/// Smooths the records: positions and torques with the same weights, so that the filter changes
/// both sides of the equations of motion alike.
std::vector<SmoothRun> smooth(const std::vector<TorqueRecord>& records, const RecordFilter& how);

}  // namespace dashpot::identification
