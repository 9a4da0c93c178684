#pragma once
#include <dashpot/identification/motion_record.hpp>

namespace dashpot::identification {

/// A first estimate of each channel's noise, from fifth differences of neighbouring samples, which
/// remove slow motion. Too large if samples are far apart.
Eigen::VectorXd first_noise(const std::vector<MotionRecord>& records,
                            Eigen::VectorXd* steps = nullptr);

/// s, the median.
double typical_step(const std::vector<MotionRecord>& records);

/// A record on an even grid of `step` (s) from its beginning, channels x points; missing samples
/// are bridged by straight lines. `widths` gets the times (s) between the samples on both sides of
/// each point.
Eigen::MatrixXd on_grid(const MotionRecord& record, double step, Eigen::MatrixXd* widths = nullptr);

/// The point from which the motion of channels x points about their end is lost in noise.
Eigen::Index audible(const Eigen::MatrixXd& grid, const Eigen::VectorXd& noise);

/// Records in few evenly spaced cells, each the mean of the samples in a stretch of time: a sum of
/// decays stays one, with the same eigenvalues, and the noise falls.
class DecayCells {
 public:
  /// Up to the point at which the motion of all channels is `lost`, at least their noise. Cells are
  /// short enough for the fastest motion; if this takes more than about `most` cells of all
  /// records, only the beginnings are covered. 0: cells of any length, for a first estimate.
  DecayCells(const std::vector<MotionRecord>& motions, const Eigen::VectorXd& sample_noise,
             const Eigen::VectorXd& lost, Eigen::Index most);

  std::vector<MotionRecord> records;  ///< in the channels' units; NaN in long gaps
  Eigen::VectorXd noise;              ///< of a cell
  double step = 0;                    ///< s
  double duration = 0;                ///< s, of the longest

  /// channels x cells, in units of the noise, about the values at the end, gaps bridged.
  std::vector<Eigen::MatrixXd> weighted() const;
  /// A cell's noise relative to a sample's.
  double noise_factor() const { return factor_; }
  Eigen::Index shortest() const;

 private:
  std::vector<Eigen::MatrixXd> bridged_;
  std::vector<Eigen::VectorXd> ends_;  ///< of each record: means of its last tenth
  double factor_ = 1;
};

}  // namespace dashpot::identification
