#pragma once
#include <dashpot/identification/motion_record.hpp>

#include <vector>

namespace dashpot::identification {

/// A sinusoid of one frequency and phase throughout a record: a hum, not a mode.
struct SteadyLine {
  double frequency = 0;   ///< rad/s
  Eigen::VectorXcd size;  ///< of the channels: real part of size exp(i frequency t) is the motion
};

/// Removes the steady lines from the samples in `grid`, channels x samples `step` s apart.
///
/// A line stands out from the spectrum near it, and its phase in eight parts of the record fits one
/// sinusoid; the phase of a mode under irregular forces wanders. In decays the line has to be small
/// and of one amplitude in the second half, where modes fade.
std::vector<SteadyLine> take_steady_lines(Eigen::MatrixXd& grid, double step,
                                          bool of_decays = false);

/// Removes hums from a record of decays, at the times of its samples.
std::vector<SteadyLine> take_hums(MotionRecord& record);

}  // namespace dashpot::identification
