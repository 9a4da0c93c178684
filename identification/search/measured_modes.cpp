#include <dashpot/identification/search/measured_modes.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::identification {

using Eigen::Index;
using Eigen::VectorXcd;

double likeness(const VectorXcd& u, const VectorXcd& v) {
  return std::norm(u.dot(v)) / std::max(1e-300, u.squaredNorm() * v.squaredNorm());
}

VectorXcd turned(const VectorXcd& shape) {
  Index largest = 0;
  shape.cwiseAbs().maxCoeff(&largest);
  const double size = std::abs(shape[largest]);
  if (size == 0) return shape;
  return (shape * (std::conj(shape[largest]) / size)).normalized();
}

namespace {

bool same_pole(const RealizedPole& a, const RealizedPole& b) {
  const double wa = modulus(a.eigenvalue), wb = modulus(b.eigenvalue);
  return std::abs(wa - wb) < 0.01 * wb &&
         std::abs(a.eigenvalue.real() / wa - b.eigenvalue.real() / wb) < 0.02 &&
         likeness(a.shape, b.shape) > 0.95;
}

/// Replaces single eigenvalues of like shapes by one overdamped mode.
void pair_reals(std::vector<MeasuredMode>& modes) {
  const auto single = [](const MeasuredMode& mode) {
    return mode.eigenvalues[0] == mode.eigenvalues[1] && mode.eigenvalues[0].real() < 0;
  };
  for (;;) {
    std::size_t best_i = 0, best_j = 0;
    double best = 0.9;
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

/// Relative deviations of what is not determined: of decays more, because those of one are widened.
constexpr double kUndetermined = 0.05, kUndeterminedInDecays = 0.06;
constexpr double kHarmonic = 3;  // of friction and other forces that are odd; sums tell even ones
constexpr double kExplains = 5;  // energy, over a mode's: what is not linear is weaker than that
constexpr double kMostEnergy = 100;     // energy of what cancels against others
constexpr double kCoincides = 0.002;    // relative: what is not linear moves the larger modes, too
constexpr double kLightlyDamped = 0.3;  // what lasts long enough to have harmonics

/// Why a mode is not to be believed; empty if it is.
std::string doubt(const MeasuredMode& mode, const std::vector<MeasuredMode>& all,
                  const Judgement& records) {
  const auto& lambda = mode.eigenvalues;
  const double vague = records.decays ? kUndeterminedInDecays : kUndetermined;
  if (lambda[0] == lambda[1] && lambda[0].imag() == 0) {
    return "a decay without oscillation, whose partner the records do not show";
  }
  if (mode.energy > kMostEnergy) return "it cancels against others like it: neither is determined";
  if (!(mode.natural_frequency_std < vague * mode.natural_frequency)) {
    return "its frequency is not determined";
  }
  if (!(mode.damping_ratio_std < vague * std::max(1.0, mode.damping_ratio))) {
    return "its damping ratio is not determined";
  }
  if (mode.natural_frequency * records.step > 2.5) return "too fast for the samples";
  if (lambda[0].imag() * records.duration < 3 && lambda[0].imag() != 0 &&
      -lambda[0].real() * records.duration < 1) {
    return "too slow for the record";
  }
  // Other orders miss heavily damped modes, but no lightly damped one that is there.
  const double enough = mode.damping_ratio < 0.1 ? 3e-3 : 1e-3;
  if (mode.stability == 0 && mode.energy < enough) return "weak, and in no model of another order";
  if (mode.energy < 1e-6) return "too weak to be told from what is not linear";
  for (const MeasuredMode& other : all) {
    if (other.energy > 2 * mode.energy && likeness(other.shape, mode.shape) > 0.8 &&
        std::abs(other.eigenvalues[0] - lambda[0]) < 0.05 * std::abs(lambda[0])) {
      return "like a larger mode next to it: its frequency changes with its size";
    }
  }
  for (const MeasuredMode& other : all) {
    if (&other == &mode || other.energy < mode.energy || !other.reason.empty()) continue;
    const double deviation = std::hypot(mode.natural_frequency_std, other.natural_frequency_std);
    if (std::abs(other.natural_frequency - mode.natural_frequency) < 4 * deviation &&
        std::abs(other.eigenvalues[0] - lambda[0]) < 0.2 * std::abs(lambda[0]) &&
        likeness(other.shape, mode.shape) > 0.8) {
      return "the same as a larger mode next to it";
    }
  }
  if (mode.damping_ratio + 2 * mode.damping_ratio_std < 0) return "it grows";
  if (mode.damping_ratio <= (records.decays ? mode.damping_ratio_std : 0)) {
    return "it does not decay within its deviation";
  }
  // Of modes that are known themselves.
  const auto explains = [&mode](const MeasuredMode& other) {
    return &other != &mode && other.energy > kExplains * mode.energy && other.energy < kMostEnergy;
  };
  const auto coincides = [&mode](double distance, double size) {
    return distance < std::max(kCoincides * size, 2 * mode.natural_frequency_std);
  };
  for (const MeasuredMode& a : all) {
    if (!explains(a)) continue;
    const double multiple = kHarmonic * a.eigenvalues[0].imag();
    if (multiple > 0 && mode.damping_ratio < kLightlyDamped &&
        coincides(std::abs(lambda[0].imag() - multiple), multiple)) {
      return "three times the frequency of a larger mode: not a mode, but what is not linear";
    }
    for (const MeasuredMode& b : all) {
      if (!explains(b)) continue;
      for (const Complex& other : {b.eigenvalues[0], b.eigenvalues[1]}) {
        if (coincides(std::abs(a.eigenvalues[0] + other - lambda[0]), std::abs(lambda[0]))) {
          return "the sum of two eigenvalues of larger modes: not a mode, but what is not linear";
        }
      }
    }
  }
  return {};
}

}  // namespace

MeasuredMode to_mode(const SteadyLine& hum) {
  MeasuredMode mode;
  mode.eigenvalues = {Complex(0, hum.frequency), Complex(0, -hum.frequency)};
  mode.natural_frequency = hum.frequency;
  mode.shape = turned(hum.size);
  mode.reason = "a steady hum, taken away";
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
                   std::max(0.05 * size, 2 * mode.natural_frequency_std);
          });
      if (!near || likeness(pole.shape, mode.shape) < 0.9) continue;
      ++having;
      break;
    }
  }
  return all > 0 ? static_cast<double>(having) / all : 0;
}

void judge(std::vector<MeasuredMode> modes, const Judgement& records, Identification& result) {
  pair_reals(modes);
  for (const MeasuredMode& mode : modes) {
    MeasuredMode judged = mode;
    if (judged.reason.empty()) judged.reason = doubt(mode, modes, records);
    (judged.reason.empty() ? result.modes : result.rejected).push_back(std::move(judged));
  }
  // A model of a decay that is not linear explains it to its noise, with modes that no model of
  // another order has; that of a linear one has fewer of those than others, or all of it is
  // believed. What moves driven and ambient motion is left over, and its colour tells.
  const auto alone = std::stable_partition(result.modes.begin(), result.modes.end(),
                                           [](const auto& mode) { return mode.stability > 0; });
  const auto stable = static_cast<std::size_t>(alone - result.modes.begin());
  constexpr double kWhite = 1.5, kCounts = 1e-3;  // energy of a rejected one
  const bool whole = std::none_of(result.rejected.begin(), result.rejected.end(),
                                  [](const auto& mode) { return mode.energy > kCounts; });
  const bool coloured = result.whiteness > kWhite && result.rejected.size() > result.modes.size();
  if (records.decays ? !whole && 2 * stable <= result.modes.size() : coloured) {
    for (auto mode = alone; mode != result.modes.end(); ++mode) {
      mode->not_linear = records.decays;
      mode->reason = records.decays
                         ? "in no model of another order, as half of this model or more"
                         : "in no model of another order, and most of this one is not believed";
      result.rejected.push_back(std::move(*mode));
    }
    result.modes.erase(alone, result.modes.end());
  }
  const auto slower = [](const MeasuredMode& a, const MeasuredMode& b) {
    return a.natural_frequency < b.natural_frequency;
  };
  std::sort(result.modes.begin(), result.modes.end(), slower);
  std::sort(result.rejected.begin(), result.rejected.end(), slower);
}

}  // namespace dashpot::identification
