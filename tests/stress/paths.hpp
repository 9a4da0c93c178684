#pragma once
// An equal number of steps on paths of every family of tests/support/tracker_paths.hpp.

#include <dashpot/tests/support/tracker_paths.hpp>

#include <algorithm>
#include <cstdint>

namespace dashpot::stress {

constexpr int kStepsOfAPath = 200;

/// Calls follow(path, path_seed, steps) for paths of a family until so many steps are made; the
/// system of step k is path(k / (kStepsOfAPath - 1)).
template <class Follow>
void follow_paths(const testing::PathFamily& family, std::uint64_t seed, long steps,
                  const Follow& follow) {
  std::uint64_t path_seed = 1'000'003 * seed;
  for (long left = steps; left > 0; left -= kStepsOfAPath, ++path_seed) {
    testing::Dice dice(path_seed);
    follow(family.make(dice), path_seed, static_cast<int>(std::min<long>(left, kStepsOfAPath)));
  }
}

/// Steps of a family of so many steps of all of them.
inline long steps_of_each(long steps) {
  const auto families = static_cast<long>(testing::path_families().size());
  return (steps + families - 1) / families;
}

}  // namespace dashpot::stress
