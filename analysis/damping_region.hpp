#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/task_space.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace dashpot::analysis {

struct RegionOptions {
  DampingTarget target;
  DampingStructure structure = DampingStructure::kFull;
  /// Largest ratio allowed. It is needed because without it ever more damping would be ever better.
  /// Not below the target's ratios. By default 1, or 1.5 times the target's larger ratio if that is
  /// more.
  std::optional<double> ceiling;
  /// Returns the sampled loop in which a configuration is to work, by its number, as
  /// LoopLimit::loop has it; called on several threads at once. Empty: the loops are taken for
  /// continuous.
  std::function<SampledLoop(std::size_t)> loop;
  double gain_margin = 2;  ///< least gain margin wanted of every loop; not below 1
  int threads = 0;         ///< 0: one for each processor; the result does not depend on it
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
  /// See analysis::gain_margin; infinite where it is not asked for.
  double gain_margin = std::numeric_limits<double>::infinity();
};

struct RegionDesign {
  Eigen::MatrixXd damping;  ///< positive semidefinite
  double level = 0;  ///< smallest ratio over all configurations, relative to its target, at most 1
  double violation = 0;   ///< by how much a ratio exceeds the ceiling: rounding, unless even no
                          ///< damping would be too much
  int worst_sample = -1;  ///< configuration with the smallest ratio
  /// Largest share found, of the matrix for continuous loops, with which every loop keeps its
  /// margin; `damping` is this share of that matrix.
  double share = 1;
  /// Smallest over all configurations; infinite for continuous loops.
  double gain_margin = std::numeric_limits<double>::infinity();
  int margin_sample = -1;  ///< configuration with the smallest gain margin; -1: none
  /// False if some loop does not keep its margin, because no share was found with which all do.
  /// Nothing in `damping` is to be used then, and `share` and `gain_margin` belong to the largest
  /// margin found.
  bool kept = true;
  std::vector<RegionSample> samples;  ///< the map of the worst mode, one for each configuration
};

/// Designs one constant damping matrix for many configurations of an arm (a grid, a trajectory, a
/// log; all with the same directions). It seeks the largest `level` such that every mode of every
/// configuration has at least `level` times its target ratio and none exceeds the ceiling.
///
/// The level is found by bisection to 5e-4 with DampingFit. The searches start from the exact
/// designs of some configurations, from their mean, and from the best matrices found so far. The
/// search does not prove that the level is the largest. For a single configuration it maximises the
/// smallest ratio within a structure.
///
/// Only the few configurations that bind are searched over: 32 at first, spread evenly. The worst
/// ones with each result join them, until no configuration misses its level by more than 2e-4 or
/// exceeds the ceiling. All are evaluated with the matrix that is returned.
///
/// With RegionOptions::loop this matrix is lowered as a whole, by the largest `share` in (0, 1]
/// with which the sampled loop of every configuration keeps the gain margin. The share is sought as
/// analysis::design_damping seeks the level of one configuration. The matrix is scaled down,
/// because a search at each level would take many times as long. All motions count in a margin,
/// soft ones too.
///
/// Throws InvalidSystem for a configuration as damping_sample does (the configuration is not
/// named), std::invalid_argument for invalid options, and like gain_margin for invalid loops.
RegionDesign design_region(const std::vector<TaskImpedance>& configurations,
                           const RegionOptions& options);

/// A question about one damping matrix: which configurations does it treat worst?
struct RegionQuestion {
  Eigen::MatrixXd damping;
  DampingTarget target;
  double level = 0;                  ///< that no configuration should miss
  double ceiling = 0;                ///< that no ratio should exceed
  std::vector<std::size_t> members;  ///< configurations that are searched over already
  /// Gain margins are sought up to this one, instead of missed levels; 0: they are not sought.
  double most_margin = 0;
};

/// The answer for some configurations, in short. It does not grow with their number.
struct RegionVerdict {
  /// Smallest ratio relative to its target; infinite if no mode counts.
  double level = std::numeric_limits<double>::infinity();
  double largest_ratio = 0;
  std::int64_t worst_sample = -1;  ///< configuration with the smallest ratio
  /// Smallest of the gain margins that are sought and found; infinite if there is none.
  double gain_margin = std::numeric_limits<double>::infinity();
  std::int64_t margin_sample = -1;  ///< configuration with the smallest gain margin
  /// The few configurations outside `members` that come off worst, worst first: minus the distance
  /// by which one misses the level or exceeds the ceiling, or its gain margin where that is sought
  /// and found; and its number.
  std::vector<std::pair<double, std::size_t>> binding;

  /// Joins the answer for other configurations. The order of joining does not matter.
  void add(const RegionVerdict& other);
};

/// Answers for the configurations with the numbers first, first + 1, ..., on the calling thread;
/// `loop` is RegionOptions::loop. Throws as design_region does.
RegionVerdict judge_region(const std::vector<TaskImpedance>& configurations, std::size_t first,
                           const RegionQuestion& question,
                           const std::function<SampledLoop(std::size_t)>& loop = {});

/// Configurations that are stored elsewhere, such as in other processes.
struct RegionSource {
  RegionSource() = default;  // so that no list of configurations converts to a source
  std::size_t count = 0;
  /// Returns one configuration; called for the few that are searched over.
  std::function<TaskImpedance(std::size_t)> configuration;
  /// Answers for all configurations; the joined answers of judge_region for their parts, which
  /// needs RegionOptions::loop where the question asks for margins.
  std::function<RegionVerdict(const RegionQuestion&)> judge;
};

/// As above, for configurations that are judged where they are stored. The design is the same to
/// the last bit, however they are divided; its `samples` are left empty.
RegionDesign design_region(const RegionSource& source, const RegionOptions& options);

/// Returns the map of the worst mode, and of the gain margins where RegionOptions::loop is given,
/// for a given damping matrix, which is not changed.
RegionDesign evaluate_region(const std::vector<TaskImpedance>& configurations,
                             const Eigen::MatrixXd& damping, const RegionOptions& options);

}  // namespace dashpot::analysis
