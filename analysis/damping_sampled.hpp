#pragma once
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/sampled_loop.hpp>

#include <optional>

namespace dashpot::analysis {

/// The loop in which a damping matrix is to work, and the room that it has to keep there.
struct LoopLimit {
  /// Its `friction` is the part of the impedance's own damping that the joints supply themselves;
  /// the rest of that damping (such as the null space's) is the controller's, as is what is
  /// designed.
  SampledLoop loop;
  double gain_margin = 2;  ///< wanted at least, see analysis::gain_margin; not below 1
};

/// A damping matrix that a sampled loop can bear.
struct SampledDamping {
  /// Of the largest ratios found, `level` times the target's, with which the loop keeps its margin.
  /// Its misses are those of the target as it was given; where only the loop is to blame, the
  /// reason is kLoop.
  DampingDesign design;
  double level = 1;         ///< in (0, 1]
  double gain_margin = 0;   ///< with the design, see analysis::gain_margin
  SampledSpectrum sampled;  ///< the modes with the design, as the sampled loop has them
  /// False if no level was found that keeps the margin: springs alone are too much for the period,
  /// and nothing in `design` is to be used. `level` and `gain_margin` are then those of the largest
  /// margin found.
  bool kept = true;
};

/// design_damping for a controller that samples, holds and delays as `limit.loop` says: the largest
/// `level` in (0, 1] is sought with which the damping designed for level times the target's ratios
/// has the gain margin that is wanted. Too little damping is unstable in such a loop as well as too
/// much: on a mass m, about
///     k (d + 1/2) T < c < 2 m / T  (half of that for d = 1).
///
/// The level is 1 where that keeps the margin. Else it is found on a grid that falls by 10 % from 1
/// to 1e-3, and to 1e-6 of itself by bisection above the first grid point that keeps the margin; if
/// none does, from the level of largest margin, by golden section. It is the largest level there is
/// as long as those that keep the margin form one interval. Up to some hundred gain margins.
///
/// Throws like design_damping and sample_loop; std::invalid_argument for a margin below 1.
SampledDamping design_damping(const TaskImpedance& impedance, const DampingTarget& target,
                              const LoopLimit& limit,
                              DampingStructure structure = DampingStructure::kFull,
                              const std::optional<Eigen::MatrixXd>& start = {});

}  // namespace dashpot::analysis
