#include <dashpot/analysis/damping_sampled.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

constexpr double kGridStep = 0.9;
constexpr double kLowestLevel = 1e-3;
constexpr double kLevelPrecision = 1e-6;
/// Of the level with the largest margin.
constexpr double kPeakPrecision = 1e-4;

DampingTarget scaled(DampingTarget target, double level) {
  target.low_ratio *= level;
  target.high_ratio *= level;
  return target;
}

/// The design at one level.
struct Leveled {
  double level = 1;
  DampingDesign design;
  double gain_margin = 0;
};

/// Designs at any level, and judges them by the loop.
class Levels {
 public:
  Levels(const TaskImpedance& impedance, const DampingTarget& target, const LoopLimit& limit,
         DampingStructure structure, const std::optional<Eigen::MatrixXd>& start)
      : impedance_(impedance),
        target_(target),
        limit_(limit),
        structure_(structure),
        start_(start) {}

  Leveled at(double level) const {
    Leveled result{level, design_damping(impedance_, scaled(target_, level), structure_, start_)};
    result.gain_margin =
        analysis::gain_margin(result.design.system, result.design.spectrum, limit_.loop);
    return result;
  }
  bool keeps(const Leveled& candidate) const { return candidate.gain_margin >= limit_.gain_margin; }

  /// The first on a falling grid that keeps the margin; else the one with the largest margin.
  Leveled first_on_grid() const {
    Leveled best = at(1);
    for (double level = kGridStep; level > kLowestLevel && !keeps(best); level *= kGridStep) {
      Leveled next = at(level);
      if (next.gain_margin > best.gain_margin) best = std::move(next);
    }
    return best;
  }

  /// Towards the largest margin between the neighbours of a grid point, by golden section, until
  /// one keeps the margin wanted.
  Leveled climb(Leveled best) const {
    constexpr double kGolden = 0.6180339887498949;
    double low = best.level * kGridStep, high = std::min(1.0, best.level / kGridStep);
    double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
    double at_left = margin_at(left, best), at_right = margin_at(right, best);
    while (high - low > kPeakPrecision * high && !keeps(best)) {
      if (at_left > at_right) {
        high = right, right = left, at_right = at_left;
        at_left = margin_at(left = high - kGolden * (high - low), best);
      } else {
        low = left, left = right, at_left = at_right;
        at_right = margin_at(right = low + kGolden * (high - low), best);
      }
    }
    return best;
  }

  /// The largest level up to that of the next grid point, from one that keeps the margin.
  Leveled raise(Leveled inside) const {
    double outside = std::min(1.0, inside.level / kGridStep);
    while (outside - inside.level > kLevelPrecision * outside) {
      Leveled middle = at(0.5 * (inside.level + outside));
      if (keeps(middle)) {
        inside = std::move(middle);
      } else {
        outside = middle.level;
      }
    }
    return inside;
  }

 private:
  /// Keeps the better one of `best` and the level asked for.
  double margin_at(double level, Leveled& best) const {
    Leveled next = at(level);
    const double margin = next.gain_margin;
    if (margin > best.gain_margin) best = std::move(next);
    return margin;
  }

  const TaskImpedance& impedance_;
  const DampingTarget& target_;
  const LoopLimit& limit_;
  DampingStructure structure_;
  const std::optional<Eigen::MatrixXd>& start_;
};

/// The misses of `target` by a design whose own target was lower, for the loop's sake.
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
  if (!(limit.gain_margin >= 1)) {
    throw std::invalid_argument("damping: a gain margin below 1 is none");
  }
  const Levels levels(impedance, target, limit, structure, start);
  Leveled best = levels.first_on_grid();
  if (!levels.keeps(best)) best = levels.climb(std::move(best));
  SampledDamping result;
  result.kept = levels.keeps(best);
  if (result.kept && best.level < 1) best = levels.raise(std::move(best));
  result.level = best.level;
  result.gain_margin = best.gain_margin;
  result.sampled = sample_loop(best.design.system, best.design.spectrum, limit.loop);
  result.design = std::move(best.design);
  if (result.level < 1) result.design.misses = misses_of(result.design, target);
  return result;
}

}  // namespace dashpot::analysis
