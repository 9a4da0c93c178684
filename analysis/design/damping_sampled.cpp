#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
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

namespace {

DampingTarget scaled(DampingTarget target, double level) {
  target.ratio *= level;
  return target;
}

/// The misses of `target` by a design whose own target was lowered for the loop.
std::vector<DampingMiss> misses_of(const DampingDesign& design, const DampingTarget& target) {
  std::vector<DampingMiss> misses =
      find_misses(design.spectrum, target, DampingMiss::Reason::kLoop);
  for (DampingMiss& miss : misses) {
    for (const DampingMiss& other : design.misses) {
      if (other.mode == miss.mode) miss.reason = other.reason;
    }
  }
  return misses;
}

}  // namespace

SampledDamping design_damping(const TaskImpedance& impedance, const DampingTarget& target,
                              const LoopLimit& limit, DampingStructure structure,
                              const std::optional<Eigen::MatrixXd>& start) {
  require("damping", limit.gain_margin >= 1, "the gain margin has to be at least 1");
  double last_level = 0;
  DampingDesign last;
  const auto at = [&](double level) -> const DampingDesign& {
    if (level != last_level) {
      last = design_damping(impedance, scaled(target, level), structure, start);
      last_level = level;
    }
    return last;
  };
  const auto margin_of = [&](const DampingDesign& design) {
    return analysis::gain_margin(design.system, design.spectrum, limit.loop);
  };
  const auto keeps = [&](double level, double margin) {
    const DampingDesign& design = at(level);
    return keeps_margin(design.system, design.spectrum, limit.loop, margin);
  };
  const FoundLevel found = find_level(
      keeps, [&](double level) { return margin_of(at(level)); }, limit.gain_margin);
  SampledDamping result;
  result.level = found.level;
  result.design = at(found.level);
  result.gain_margin = margin_of(result.design);
  result.kept = found.kept && result.gain_margin >= (1 - kMarginPrecision) * limit.gain_margin;
  if (result.kept) result.gain_margin = std::max(result.gain_margin, limit.gain_margin);
  result.sampled = sample_loop(result.design.system, result.design.spectrum, limit.loop);
  if (result.level < 1) result.design.misses = misses_of(result.design, target);
  return result;
}

}  // namespace dashpot::analysis
