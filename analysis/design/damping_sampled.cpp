#include <dashpot/analysis/base/require.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/analysis/design/level_search.hpp>

#include <algorithm>

namespace dashpot::analysis {
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
