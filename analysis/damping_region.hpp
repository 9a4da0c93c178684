#pragma once
#include <dashpot/analysis/design/damping_fit.hpp>

#include <functional>
#include <optional>
#include <vector>

namespace dashpot::analysis {

struct RegionOptions {
  DampingTarget target;
  DampingStructure structure = DampingStructure::kFull;
  /// Largest ratio allowed. It is needed because without it ever more damping would be ever better.
  /// Not below the target's ratios. By default 1, or 1.5 times the target's larger ratio if that is
  /// more.
  std::optional<double> ceiling;
  EntryBounds bounds;  ///< on the entries of the damping matrix; none by default
  int threads = 0;     ///< 0: one for each processor; the result does not depend on it
  /// Called now and then with the share done, rising from 0 to 1, on the calling thread.
  std::function<void(double)> progress;
};

/// Effect of the one damping matrix on one of the configurations.
struct RegionSample {
  int worst_mode = -1;           ///< index in its spectrum; -1 if it has no mode that is not soft
  double natural_frequency = 0;  ///< of the worst mode, rad/s
  double damping_ratio = 0;
  double wanted = 0;
  double largest_ratio = 0;
  int soft_modes = 0;
};

struct RegionDesign {
  Eigen::MatrixXd damping;  ///< positive semidefinite
  double level = 0;  ///< smallest ratio over all configurations, relative to its target, at most 1
  double violation = 0;   ///< by how much a ratio exceeds the ceiling, or an entry its bounds
                          ///< (relative): rounding, unless even no damping would be too much
  int worst_sample = -1;  ///< configuration with the smallest ratio
  std::vector<RegionSample> samples;  ///< the map of the worst mode, one for each configuration
};

/// Designs one constant damping matrix for many configurations of an arm (a grid, a trajectory, a
/// log; all with the same directions). It seeks the largest `level` such that every mode of every
/// configuration has at least `level` times its target ratio and none exceeds the ceiling.
///
/// The level is found by bisection to 5e-4 with DampingFit. The searches start from the exact
/// designs of some configurations, from their mean, and from the best matrices found so far. This
/// is no proof of the largest level. With a single configuration it is the largest smallest ratio
/// within a structure and bounds.
///
/// A few configurations bind, and those alone are searched over: 32 at first, spread evenly, joined
/// by those that come off worst with what was found, until no configuration misses its level by
/// more than 2e-4 or exceeds the ceiling. All are evaluated with the matrix that is returned.
///
/// Throws InvalidSystem for a configuration as damping_sample does (the configuration is not
/// named), and std::invalid_argument for invalid options.
RegionDesign design_region(const std::vector<TaskImpedance>& configurations,
                           const RegionOptions& options);

/// Returns the map of the worst mode for a given damping matrix, which is not changed.
RegionDesign evaluate_region(const std::vector<TaskImpedance>& configurations,
                             const Eigen::MatrixXd& damping, const RegionOptions& options);

}  // namespace dashpot::analysis
