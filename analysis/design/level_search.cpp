#include <dashpot/analysis/design/level_search.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

constexpr double kGridStep = 2. / 3;
constexpr double kLowestLevel = 1e-3;
/// Relative precision of a level, which is approached from below.
constexpr double kLevelPrecision = 1e-6;
/// The peak of a margin below this part of the one wanted is found less precisely.
constexpr double kReach = 0.8, kCoarse = 3e-3;
/// gain_margin finds no margin below this.
constexpr double kLeastQuestion = 1e-3;

/// The level with the largest margin that is found, or one that keeps the margin wanted.
FoundLevel find_peak(const std::function<bool(double, double)>& keeps,
                     const std::function<double(double)>& margin, double wanted) {
  constexpr double kGolden = 0.3819660112501051;
  double largest = margin(1);
  double low = std::log(kLowestLevel), high = 0, best = 0;  // logarithms of levels
  const auto precision = [&] { return largest < kReach * wanted ? kCoarse : kLevelPrecision; };
  while (largest < wanted && high - low > precision()) {
    const bool below = best - low > high - best;
    const double next = best - kGolden * (below ? best - low : best - high);
    if (keeps(std::exp(next), std::max(largest, kLeastQuestion))) {
      (below ? high : low) = best;
      best = next;
      largest = std::max(largest, margin(std::exp(next)));
    } else {
      (below ? low : high) = next;
    }
  }
  return {std::exp(best), largest >= wanted && keeps(std::exp(best), wanted)};
}

}  // namespace

FoundLevel find_level(const std::function<bool(double, double)>& keeps,
                      const std::function<double(double)>& margin, double wanted) {
  FoundLevel found{1, keeps(1, wanted)};
  for (double level = kGridStep; level > kLowestLevel && !found.kept; level *= kGridStep) {
    found = {level, keeps(level, wanted)};
  }
  if (!found.kept) found = find_peak(keeps, margin, wanted);
  if (!found.kept) return found;
  double outside = std::min(1.0, found.level / kGridStep);
  while (outside - found.level > kLevelPrecision * outside) {
    const double middle = 0.5 * (found.level + outside);
    (keeps(middle, wanted) ? found.level : outside) = middle;
  }
  return found;
}

}  // namespace dashpot::analysis
