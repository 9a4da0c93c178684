#pragma once
// Stability of a loop with many ticks of delay, whose states only shift: all work is done on the
// states of the robot and the controller.

#include <dashpot/analysis/sampled/sampled_data_model.hpp>

namespace dashpot::analysis {

/// Counts the eigenvalues of SampledDataModel::transition() inside the unit circle by the argument
/// principle. They are the zeros of det F(z),
///     F(z) = z - A - h(z) B C(z),   h(z) = z^-d f / (1 - (1 - f) / z),
/// p x p with p = 2n + m, whatever the delay d is, where A and B are the robot and the states w and
/// C the controller. F has its poles at zero and at 1 - f, and det F grows like z^p. So its phase
/// turns p times along a closed path that has all zeros inside.
class CircleCount {
 public:
  /// Zeros with |log z| below `slowest` count as inside; it is 1e-6 where it is less, so that zero
  /// modes may rest at z = 1.
  CircleCount(const SampledDataModel& loop, double slowest);

  /// With `factor` times K - P, C - D and the output of w: returns about the distance of the path
  /// from the nearest zero; negative if all zeros are inside, and the loop is stable.
  ///
  /// No step from one point of the path to the next can miss a zero. With
  /// E = F(z1)^-1 F(z) - 1 on the path between them, |E| <= |z1 - z| N entry by entry, so that the
  /// phase of det F is known from the traces of E and E^2 to less than half a turn. A zero closer
  /// than 1e-9 to the path counts as outside. The number of steps grows with the logarithm of the
  /// distance.
  double excess(double factor) const;

 private:
  double slowest_;
  double delay_, filter_gain_;
  bool differences_;
  double rate_;                           ///< largest |d log h / d log z|
  Eigen::MatrixXd rest_;                  ///< A - 1
  Eigen::MatrixXd fixed_[2], scaled_[2];  ///< B C(z) = (fixed + factor scaled)[0] + [1] (1 - 1 / z)
};

}  // namespace dashpot::analysis
