#pragma once
#include <dashpot/identification/model/decay_data.hpp>

#include <memory>
#include <vector>

namespace dashpot::identification {

/// Records with inputs in evenly spaced cells, each the mean of the samples in a stretch of time.
struct ExcitedCells {
  /// Throws std::invalid_argument if no input moves, or nothing follows it.
  explicit ExcitedCells(const std::vector<MotionRecord>& all);

  std::vector<MotionRecord> records;  ///< in the channels' units; NaN in gaps
  std::vector<MotionRecord> bridged;  ///< in units of the noise, gaps bridged by straight lines
  std::shared_ptr<const std::vector<DrivenGrid>> driven;
  Eigen::VectorXd noise;  ///< of a cell, a first estimate
  double step = 0;        ///< s
  double duration = 0;    ///< s, of the longest
  double highest = 0;     ///< rad/s, up to which the motion stands out from the noise
};

}  // namespace dashpot::identification
