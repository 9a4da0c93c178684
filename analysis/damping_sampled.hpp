#pragma once
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/sampled_loop.hpp>

#include <optional>

namespace dashpot::analysis {

/// The loop in which a damping matrix is to work, and the margin that it has to keep there.
struct LoopLimit {
  /// Its `friction` is the part of the impedance's own damping that the joints supply themselves.
  /// The rest of the impedance's damping (such as the null-space damping) is the controller's, and
  /// so is the designed damping.
  SampledLoop loop;
  double gain_margin = 2;  ///< least gain margin wanted, see analysis::gain_margin; not below 1
};

/// A damping matrix with which a sampled loop keeps its gain margin.
struct SampledDamping {
  /// The design for `level` times the target's ratios, the largest ratios found with which the loop
  /// keeps its margin. Its misses are relative to the target as given. The reason is kLoop if only
  /// the loop prevents the ratio.
  DampingDesign design;
  double level = 1;         ///< in (0, 1]
  double gain_margin = 0;   ///< with the design, see analysis::gain_margin
  SampledSpectrum sampled;  ///< the modes of the sampled loop with the design
  /// False if no level was found that keeps the margin, because springs alone are too much for the
  /// period. Nothing in `design` is to be used then, and `level` and `gain_margin` belong to the
  /// largest margin found.
  bool kept = true;
};

/// Designs a damping matrix as design_damping does, for a controller that samples, holds and delays
/// as `limit.loop` says. It seeks the largest `level` in (0, 1] for which the damping designed for
/// `level` times the target's ratios has the gain margin that is wanted. In such a loop too little
/// damping is unstable as well as too much: a mass m is stable for about
///     k (d + 1/2) T < c < 2 m / T  (half of the right side for d = 1).
///
/// The level is 1 if that keeps the margin. Otherwise it is found on a grid that falls by a third
/// from 1 to 1e-3, and to 1e-6 of itself by bisection above the first grid point that keeps the
/// margin. If no grid point keeps the margin, the level of largest margin is sought by golden
/// section, to 3e-3 of itself where that margin is out of reach. The result is the largest level
/// there is as long as the levels that keep the margin form one interval. The search asks some tens
/// of times whether a margin is kept, and, if no grid point keeps it, for some ten margins.
///
/// Throws like design_damping and sample_loop, and std::invalid_argument for a margin below 1.
SampledDamping design_damping(const TaskImpedance& impedance, const DampingTarget& target,
                              const LoopLimit& limit,
                              DampingStructure structure = DampingStructure::kFull,
                              const std::optional<Eigen::MatrixXd>& start = {});

}  // namespace dashpot::analysis
