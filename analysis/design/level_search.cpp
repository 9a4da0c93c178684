#include <dashpot/analysis/design/level_search.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

constexpr double kGridStep = 2. / 3;
constexpr double kLowestLevel = 1e-3;
/// Of a level, which is found from below.
constexpr double kLevelPrecision = 1e-6;
/// The peak of a margin below this part of the one wanted is found less precisely.
constexpr double kReach = 0.8, kCoarse = 3e-3;

/// The level with the largest margin that is found, or one that keeps the margin wanted.
FoundLevel find_peak(const std::function<bool(double)>& keeps,
                     const std::function<double(double)>& margin, double wanted) {
  constexpr double kGolden = 0.6180339887498949;
  double best = 1, largest = margin(1);
  const auto ask = [&](double log_level) {
    const double level = std::exp(log_level), found = margin(level);
    if (found > largest) best = level, largest = found;
    return found;
  };
  double low = std::log(kLowestLevel), high = 0;
  double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
  double at_left = ask(left), at_right = ask(right);
  const auto precision = [&] { return largest < kReach * wanted ? kCoarse : kLevelPrecision; };
  while (largest < wanted && high - low > precision()) {
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
