#include <dashpot/analysis/damping_sampled.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

constexpr double kGridStep = 2. / 3;
constexpr double kLowestLevel = 1e-3;
constexpr double kLevelPrecision = 1e-6;
/// Of the level with the largest margin.
constexpr double kPeakPrecision = 3e-3;

DampingTarget scaled(DampingTarget target, double level) {
  target.low_ratio *= level;
  target.high_ratio *= level;
  return target;
}

/// The design at one level.
struct Leveled {
  double level = 1;
  DampingDesign design;
  bool keeps = false;      ///< the margin wanted
  double gain_margin = 0;  ///< where it was asked for
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

  /// The first on a falling grid that keeps the margin; else any.
  Leveled first_on_grid() const {
    Leveled next = at(1);
    for (double level = kGridStep; level > kLowestLevel && !next.keeps; level *= kGridStep) {
      next = at(level);
    }
    return next;
  }

  /// The one with the largest margin that is found, or one that keeps the margin wanted: on the
  /// grid, then by golden section between the neighbours of the best there.
  Leveled best() const {
    constexpr double kGolden = 0.6180339887498949;
    Leveled best = at(1);
    best.gain_margin = margin_of(best.design);
    for (double level = kGridStep; level > kLowestLevel; level *= kGridStep) {
      margin_at(level, best);
    }
    double low = best.level * kGridStep, high = std::min(1.0, best.level / kGridStep);
    double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
    double at_left = margin_at(left, best), at_right = margin_at(right, best);
    while (high - low > kPeakPrecision * high && !best.keeps) {
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
      if (middle.keeps) {
        inside = std::move(middle);
      } else {
        outside = middle.level;
      }
    }
    return inside;
  }

  double margin_of(const DampingDesign& design) const {
    return analysis::gain_margin(design.system, design.spectrum, limit_.loop);
  }

 private:
  Leveled at(double level) const {
    Leveled result{level, design_damping(impedance_, scaled(target_, level), structure_, start_)};
    const DampingDesign& design = result.design;
    result.keeps = keeps_margin(design.system, design.spectrum, limit_.loop, limit_.gain_margin);
    return result;
  }

  /// Keeps the better one of `best` and the level asked for.
  double margin_at(double level, Leveled& best) const {
    Leveled next = at(level);
    const double margin = next.gain_margin = margin_of(next.design);
    if (next.keeps || (margin > best.gain_margin && !best.keeps)) best = std::move(next);
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
  Leveled found = levels.first_on_grid();
  if (!found.keeps) found = levels.best();
  if (found.keeps && found.level < 1) found = levels.raise(std::move(found));
  SampledDamping result;
  result.kept = found.keeps;
  result.level = found.level;
  result.gain_margin = levels.margin_of(found.design);
  // Its search has other brackets, and may end a rounding error below.
  if (result.kept) result.gain_margin = std::max(result.gain_margin, limit.gain_margin);
  result.sampled = sample_loop(found.design.system, found.design.spectrum, limit.loop);
  result.design = std::move(found.design);
  if (result.level < 1) result.design.misses = misses_of(result.design, target);
  return result;
}

}  // namespace dashpot::analysis
