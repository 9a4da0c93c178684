#include <dashpot/identification/search/measured_modes.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::identification {

namespace {

// A pole is stable if the model of one order less has it within these; see ModelPole.
constexpr double kStableFrequency = 0.01, kStableRatio = 0.02, kStableShape = 0.95;
// A model of another order has a mode within these: relative, deviations, and likeness.
constexpr double kHasIt = 0.05, kHasItDeviations = 2, kHasItShape = 0.9;
constexpr double kPairShapes = 0.9;  ///< likeness of single eigenvalues of one overdamped mode

bool same_pole(const RealizedPole& a, const RealizedPole& b) {
  const double wa = modulus(a.eigenvalue), wb = modulus(b.eigenvalue);
  return std::abs(wa - wb) < kStableFrequency * wb &&
         std::abs(a.eigenvalue.real() / wa - b.eigenvalue.real() / wb) < kStableRatio &&
         likeness(a.shape, b.shape) > kStableShape;
}

/// Replaces single eigenvalues of like shapes by one overdamped mode.
void pair_reals(std::vector<MeasuredMode>& modes) {
  const auto single = [](const MeasuredMode& mode) {
    return mode.eigenvalues[0] == mode.eigenvalues[1] && mode.eigenvalues[0].real() < 0;
  };
  for (;;) {
    std::size_t best_i = 0, best_j = 0;
    double best = kPairShapes;
    for (std::size_t i = 0; i < modes.size(); ++i) {
      for (std::size_t j = i + 1; j < modes.size(); ++j) {
        if (!single(modes[i]) || !single(modes[j])) continue;
        const double alike = likeness(modes[i].shape, modes[j].shape);
        if (alike > best) best = alike, best_i = i, best_j = j;
      }
    }
    if (best_i == best_j) return;
    MeasuredMode& a = modes[best_i];
    const MeasuredMode b = modes[best_j];
    const double x = a.eigenvalues[0].real(), y = b.eigenvalues[0].real();
    const double sx = a.natural_frequency_std, sy = b.natural_frequency_std;
    const double w = std::sqrt(x * y);
    a.natural_frequency = w;
    a.damping_ratio = -(x + y) / (2 * w);
    // w by x is w / (2 x); the ratio by x is (y - x) / (4 x w).
    a.natural_frequency_std = std::hypot(w / (2 * x) * sx, w / (2 * y) * sy);
    a.damping_ratio_std = std::hypot((y - x) / (4 * x * w) * sx, (x - y) / (4 * y * w) * sy);
    a.eigenvalues = {std::max(x, y), std::min(x, y)};
    if (x < y) a.shape = b.shape;
    a.energy += b.energy;
    a.stability = std::min(a.stability, b.stability);
    modes.erase(modes.begin() + static_cast<std::ptrdiff_t>(best_j));
  }
}

/// The modes with the reasons that a stage finds; each mode is weighed independently.
std::vector<MeasuredMode> weighed(Stage stage, const std::vector<MeasuredMode>& modes,
                                  const RecordFacts& records) {
  std::vector<MeasuredMode> result = modes;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    if (modes[k].reason.empty()) weigh(stage, {modes[k], modes, records}, result[k]);
  }
  return result;
}

}  // namespace

MeasuredMode to_mode(const SteadyLine& hum) {
  MeasuredMode mode;
  mode.eigenvalues = {Complex(0, hum.frequency), Complex(0, -hum.frequency)};
  mode.natural_frequency = hum.frequency;
  mode.shape = turned(hum.size);
  weigh(Stage::kHum, {mode}, mode);
  return mode;
}

std::vector<ModelPole> model_poles(const std::vector<std::vector<RealizedPole>>& by_order) {
  std::vector<ModelPole> result;
  for (std::size_t n = 0; n < by_order.size(); ++n) {
    for (const RealizedPole& pole : by_order[n]) {
      const auto is_same = [&pole](const RealizedPole& before) { return same_pole(pole, before); };
      const double w = modulus(pole.eigenvalue);
      result.push_back(
          {static_cast<int>(n) + 1, w, -pole.eigenvalue.real() / w,
           n > 0 && std::any_of(by_order[n - 1].begin(), by_order[n - 1].end(), is_same)});
    }
  }
  return result;
}

double stability_of(const MeasuredMode& mode,
                    const std::vector<std::vector<RealizedPole>>& by_order, int order) {
  int having = 0, all = 0;
  for (std::size_t n = static_cast<std::size_t>(order) - 1; n < by_order.size(); ++n) {
    ++all;
    for (const RealizedPole& pole : by_order[n]) {
      const bool near =
          std::any_of(mode.eigenvalues.begin(), mode.eigenvalues.end(), [&](const Complex& lambda) {
            const double size = std::abs(lambda);
            return std::abs(pole.eigenvalue - lambda) <
                   std::max(kHasIt * size, kHasItDeviations * mode.natural_frequency_std);
          });
      if (!near || likeness(pole.shape, mode.shape) < kHasItShape) continue;
      ++having;
      break;
    }
  }
  return all > 0 ? static_cast<double>(having) / all : 0;
}

void judge(std::vector<MeasuredMode> modes, const RecordFacts& records, Identification& result) {
  if (records.kind != MotionKind::kAmbient) modes = weighed(Stage::kLeftOver, modes, records);
  pair_reals(modes);
  modes = weighed(Stage::kMode, modes, records);
  for (MeasuredMode& mode : weighed(Stage::kTogether, modes, records)) {
    (mode.reason.empty() ? result.modes : result.rejected).push_back(std::move(mode));
  }
  const auto slower = [](const MeasuredMode& a, const MeasuredMode& b) {
    return a.natural_frequency < b.natural_frequency;
  };
  std::sort(result.modes.begin(), result.modes.end(), slower);
  std::sort(result.rejected.begin(), result.rejected.end(), slower);
}

}  // namespace dashpot::identification
