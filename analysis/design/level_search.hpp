#pragma once
#include <functional>

namespace dashpot::analysis {

/// A gain margin has this relative error: its search and the test whether it is kept may use
/// different brackets.
inline constexpr double kMarginPrecision = 1e-6;

/// A share of the damping wanted, and whether a loop keeps its margin with it.
struct FoundLevel {
  double level = 1;
  bool kept = true;
};

/// Seeks the largest level in (0, 1] at which a loop keeps the gain margin `wanted`: on a grid that
/// falls by a third from 1 to 1e-3, and to 1e-6 of itself by bisection above the first grid point
/// that keeps the margin. If no grid point keeps it, the level with the largest margin is sought by
/// golden section, as if the margin rose and then fell with the level: to 1e-6 of itself if the
/// margin found comes to 0.8 of the one wanted, otherwise to 3e-3. If this level does not keep the
/// margin either, it is returned.
///
/// keeps(level, m) is true if the margin at a level is at least m; margin(level) is the margin.
/// margin is called only if no grid point keeps the margin: for level 1, and for levels as good as
/// the best before. One call of keeps rejects the others.
FoundLevel find_level(const std::function<bool(double, double)>& keeps,
                      const std::function<double(double)>& margin, double wanted);

}  // namespace dashpot::analysis
