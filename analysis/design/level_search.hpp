#pragma once
#include <functional>

namespace dashpot::analysis {

/// A gain margin has this relative error: its search may have other brackets than the question
/// whether it is kept.
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
/// margin found comes to 0.8 of the one wanted, otherwise to 3e-3. If that does not keep the margin
/// either, it is the level found.
///
/// keeps(level, m) says whether the margin there is at least m; margin(level) is it. That is asked
/// for only where no grid point keeps the margin, and there of level 1 and of levels that are as
/// good as the best before: the others are told by one question.
FoundLevel find_level(const std::function<bool(double, double)>& keeps,
                      const std::function<double(double)>& margin, double wanted);

}  // namespace dashpot::analysis
