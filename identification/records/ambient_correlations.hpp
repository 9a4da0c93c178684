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

/// Correlations of all channels with each channel: for each of these channels x lags, from lag 1.
using Correlations = std::vector<Eigen::MatrixXd>;

/// The sum of the squares at `count` lags from `first` on.
double squares(const Correlations& a, Eigen::Index first, Eigen::Index count);

/// The correlations of the parts of records, of the same length and number of lags each.
class AmbientCorrelations {
 public:
  /// Throws std::invalid_argument for records that are too short.
  explicit AmbientCorrelations(const std::vector<MotionRecord>& records);

  /// Returns the mean over the parts for whose number `chosen` is true.
  template <typename Chosen>
  Correlations mean(const Chosen& chosen) const {
    Correlations sum(parts[0].size(),
                     Eigen::MatrixXd::Zero(parts[0][0].rows(), parts[0][0].cols()));
    double count = 0;
    for (std::size_t k = 0; k < parts.size(); ++k) {
      if (!chosen(k)) continue;
      for (std::size_t j = 0; j < sum.size(); ++j) sum[j] += parts[k][j];
      ++count;
    }
    for (Eigen::MatrixXd& m : sum) m /= count;
    return sum;
  }

  std::vector<Correlations> parts;
  Eigen::VectorXd sizes;             ///< of the channels, in units of which the correlations are
  Eigen::VectorXd noise;             ///< of the channels' samples
  double step = 0;                   ///< between lags, s
  std::vector<Eigen::Index> delays;  ///< of the rows and columns of their Hankel matrix, steps
  double duration = 0;               ///< of the longest record, s
  std::vector<SteadyLine> hums;      ///< removed from the records before

 private:
  void shorten(Eigen::Index lags);
};

}  // namespace dashpot::identification
