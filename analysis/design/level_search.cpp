#include <dashpot/analysis/design/level_search.hpp>

#include <algorithm>

namespace dashpot::analysis {
namespace {

constexpr double kGridStep = 2. / 3;
constexpr double kLowestLevel = 1e-3;
constexpr double kLevelPrecision = 1e-6;
/// Of the level with the largest margin.
constexpr double kPeakPrecision = 3e-3;

/// The level with the largest margin that is found, or one that keeps the margin wanted: on the
/// grid, then by golden section between the neighbours of the best there.
FoundLevel find_peak(const std::function<bool(double)>& keeps,
                     const std::function<double(double)>& margin, double wanted) {
  constexpr double kGolden = 0.6180339887498949;
  double best = 1, largest = margin(1);
  const auto ask = [&](double level) {
    const double found = margin(level);
    if (found > largest) best = level, largest = found;
    return found;
  };
  for (double level = kGridStep; level > kLowestLevel; level *= kGridStep) ask(level);
  double low = best * kGridStep, high = std::min(1.0, best / kGridStep);
  double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
  double at_left = ask(left), at_right = ask(right);
  while (high - low > kPeakPrecision * high && largest < wanted) {
    if (at_left > at_right) {
      high = right, right = left, at_right = at_left;
      at_left = ask(left = high - kGolden * (high - low));
    } else {
      low = left, left = right, at_left = at_right;
      at_right = ask(right = low + kGolden * (high - low));
    }
  }
  return {best, largest >= wanted && keeps(best)};
}

}  // namespace

FoundLevel find_level(const std::function<bool(double)>& keeps,
                      const std::function<double(double)>& margin, double wanted) {
  FoundLevel found{1, keeps(1)};
  for (double level = kGridStep; level > kLowestLevel && !found.kept; level *= kGridStep) {
    found = {level, keeps(level)};
  }
  if (!found.kept) found = find_peak(keeps, margin, wanted);
  if (!found.kept) return found;
  double outside = std::min(1.0, found.level / kGridStep);
  while (outside - found.level > kLevelPrecision * outside) {
    const double middle = 0.5 * (found.level + outside);
    (keeps(middle) ? found.level : outside) = middle;
  }
  return found;
}

}  // namespace dashpot::analysis
