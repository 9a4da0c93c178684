#pragma once
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/design/damping_fit.hpp>

#include <cstddef>
#include <vector>

namespace dashpot::analysis {

/// A configuration that misses the level by less need not join the search.
inline constexpr double kLevelMissed = 2e-4;
/// A search that comes as near as this to its goal has reached it.
inline constexpr double kLevelMet = 1e-7;
/// Configurations that join a search at a time.
inline constexpr std::size_t kJoining = 8;

using LoopOf = std::function<SampledLoop(std::size_t)>;

/// Returns what a question's damping does to configuration `number`.
RegionSample judge_sample(const DampingSample& sample, std::size_t number,
                          const RegionQuestion& question, const LoopOf& loop);

/// Returns the answer of the configurations first, first + 1, ..., with these samples.
RegionVerdict verdict_of(const std::vector<RegionSample>& samples, std::size_t first,
                         const RegionQuestion& question);

}  // namespace dashpot::analysis
