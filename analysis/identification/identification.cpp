#include <dashpot/analysis/identification.hpp>
#include <dashpot/analysis/identification/model_search.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument("identify: " + message);
}

/// |u' v|^2 / (|u|^2 |v|^2), the modal assurance criterion.
double likeness(const VectorXcd& u, const VectorXcd& v) {
  return std::norm(u.dot(v)) / std::max(1e-300, u.squaredNorm() * v.squaredNorm());
}

bool same_pole(const RealizedPole& a, const RealizedPole& b) {
  const double wa = modulus(a.eigenvalue), wb = modulus(b.eigenvalue);
  return std::abs(wa - wb) < 0.01 * wb &&
         std::abs(a.eigenvalue.real() / wa - b.eigenvalue.real() / wb) < 0.02 &&
         likeness(a.shape, b.shape) > 0.95;
}

/// The shape of a factor's first eigenvalue, from its amplitudes.
VectorXcd shape_of(const DecayFactor& factor, const MatrixXd& amplitude) {
  if (!factor.pair) return amplitude.row(0).transpose().cast<Complex>();
  const auto lambda = factor.eigenvalues();
  const double w = std::exp(factor.first);
  const VectorXd c = amplitude.row(0), s = w * amplitude.row(1);
  if (lambda[0].imag() != 0) {
    return c.cast<Complex>() - Complex(0, 1) / lambda[0].imag() * s.cast<Complex>();
  }
  // e^{-a t / 2} (c cosh + s sinh / d), with d half of the difference of the eigenvalues.
  const double d = (lambda[0].real() - lambda[1].real()) / 2;
  const double safe = std::abs(d) > 1e-9 * w ? d : 1e-9 * w;
  return ((c + s / safe) / 2).cast<Complex>();
}

/// Of unit length, its largest entry real and positive.
VectorXcd turned(const VectorXcd& shape) {
  Index largest = 0;
  shape.cwiseAbs().maxCoeff(&largest);
  const double size = std::abs(shape[largest]);
  if (size == 0) return shape;
  return (shape * (std::conj(shape[largest]) / size)).normalized();
}

MeasuredMode to_mode(const ModelSearch& search, std::size_t k, Index at, const VectorXd& scale,
                     double all) {
  const DecayFit& fit = search.fit;
  const DecayFactor& factor = fit.factors[k];
  MeasuredMode mode;
  mode.eigenvalues = factor.eigenvalues();
  const auto variance = [&fit](Index i) { return std::sqrt(std::max(0.0, fit.covariance(i, i))); };
  if (factor.pair) {
    mode.natural_frequency = std::exp(factor.first);
    mode.natural_frequency_std = mode.natural_frequency * variance(at);
    mode.damping_ratio = factor.second;
    mode.damping_ratio_std = variance(at + 1);
    mode.covariance = mode.natural_frequency * fit.covariance(at, at + 1);
  } else {
    mode.natural_frequency = std::abs(factor.first);
    mode.natural_frequency_std = variance(at);
    mode.damping_ratio = factor.first < 0 ? 1 : -1;
    mode.damping_ratio_std = kInfinity;
  }
  double energy = 0;
  const std::vector<MatrixXd> motion = factor_motion(search.data, fit, k);
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const auto& channels = search.data.parts[i].channels;
    for (std::size_t c = 0; c < channels.size(); ++c) {
      energy += motion[i].col(static_cast<Index>(c)).squaredNorm() / scale[channels[c]];
    }
  }
  mode.energy = energy / all;
  mode.shape = turned(shape_of(factor, fit.amplitudes.middleRows(at, factor.parameters())));
  return mode;
}

/// Adds to the variances what the next larger model thinks otherwise: whether there is one mode
/// more is not known for sure, either.
void doubt_order(const DecayFit& fit, const DecayFit& larger, std::vector<MeasuredMode>& modes) {
  for (std::size_t k = 0; k < modes.size(); ++k) {
    if (!fit.factors[k].pair) continue;
    const DecayFactor* nearest = nullptr;
    double least = kInfinity;
    for (const DecayFactor& factor : larger.factors) {
      if (!factor.pair) continue;
      const double distance =
          std::abs(factor.eigenvalues()[0] - modes[k].eigenvalues[0]) / modes[k].natural_frequency;
      if (distance < least) least = distance, nearest = &factor;
    }
    if (nearest == nullptr) continue;
    MeasuredMode& mode = modes[k];
    const double dw = std::exp(nearest->first) - mode.natural_frequency;
    const double dz = nearest->second - mode.damping_ratio;
    mode.natural_frequency_std = std::hypot(mode.natural_frequency_std, dw);
    mode.damping_ratio_std = std::hypot(mode.damping_ratio_std, dz);
    mode.covariance += dw * dz;
  }
}

/// The share of the realizations of the chosen order and above that have this eigenvalue.
double stability_of(const MeasuredMode& mode, const ModelSearch& search) {
  int having = 0, all = 0;
  for (std::size_t n = static_cast<std::size_t>(search.order) - 1; n < search.by_order.size();
       ++n) {
    ++all;
    for (const RealizedPole& pole : search.by_order[n]) {
      const bool near =
          std::any_of(mode.eigenvalues.begin(), mode.eigenvalues.end(), [&](const Complex& lambda) {
            const double size = std::abs(lambda);
            return std::abs(pole.eigenvalue - lambda) <
                   std::max(0.05 * size, 3 * mode.natural_frequency_std);
          });
      if (!near || likeness(pole.shape, mode.shape) < 0.9) continue;
      ++having;
      break;
    }
  }
  return all > 0 ? static_cast<double>(having) / all : 0;
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

/// Why a mode is not to be believed; empty if it is.
std::string doubt(const MeasuredMode& mode, const std::vector<MeasuredMode>& all, double duration,
                  double step) {
  const auto& lambda = mode.eigenvalues;
  if (lambda[0] == lambda[1] && lambda[0].imag() == 0) {
    return "a decay without oscillation, whose partner the records do not show";
  }
  if (mode.energy > 100) return "it cancels against others like it: neither is determined";
  if (!(mode.natural_frequency_std < 0.05 * mode.natural_frequency)) {
    return "its frequency is not determined";
  }
  if (!(mode.damping_ratio_std < 0.05 * std::max(1.0, mode.damping_ratio))) {
    return "its damping ratio is not determined";
  }
  if (mode.natural_frequency * step > 2.5) return "too fast for the samples";
  if (lambda[0].imag() * duration < 3 && lambda[0].imag() != 0 &&
      -lambda[0].real() * duration < 1) {
    return "too slow for the record";
  }
  if (mode.stability == 0 && mode.energy < 1e-3) return "weak, and in no model of another order";
  if (mode.energy < 1e-6) return "too weak to be told from what is not linear";
  for (const MeasuredMode& other : all) {
    if (other.energy > 2 * mode.energy && likeness(other.shape, mode.shape) > 0.8 &&
        std::abs(other.eigenvalues[0] - lambda[0]) < 0.05 * std::abs(lambda[0])) {
      return "like a larger mode next to it: its frequency changes with its size";
    }
  }
  if (mode.damping_ratio < -2 * mode.damping_ratio_std) return "it grows";
  for (const MeasuredMode& a : all) {
    for (const MeasuredMode& b : all) {
      if (&a == &mode || &b == &mode || a.energy < 10 * mode.energy ||
          b.energy < 10 * mode.energy) {
        continue;
      }
      for (const Complex& other : {b.eigenvalues[0], b.eigenvalues[1]}) {
        const Complex sum = a.eigenvalues[0] + other;
        if (std::abs(sum - lambda[0]) <
            std::max(0.005 * std::abs(lambda[0]), 2 * mode.natural_frequency_std)) {
          return "the sum of two eigenvalues of larger modes: not a mode, but what is not linear";
        }
      }
    }
  }
  return {};
}

}  // namespace

Identification identify_decays(const std::vector<MotionRecord>& records,
                               const IdentifyOptions& options) {
  check_records(records);
  require(options.max_order >= 0 && options.max_order <= 60, "max_order has to be within 0 and 60");
  const ModelSearch search(records, options.max_order, options.refine);
  Identification result;
  result.noise = search.fit.noise;
  result.whiteness = search.fit.whiteness;
  const RealizedPole none{};
  for (std::size_t n = 0; n < search.by_order.size(); ++n) {
    for (const RealizedPole& pole : search.by_order[n]) {
      const auto is_same = [&pole](const RealizedPole& before) { return same_pole(pole, before); };
      const double w = modulus(pole.eigenvalue);
      result.poles.push_back({static_cast<int>(n) + 1, w, -pole.eigenvalue.real() / w,
                              n > 0 && std::any_of(search.by_order[n - 1].begin(),
                                                   search.by_order[n - 1].end(), is_same)});
    }
  }

  // The motion of each channel about its constant, and what is left of it.
  VectorXd scale = VectorXd::Zero(search.data.channels), rest = scale;
  const auto over = left_over(search.data, search.fit);
  for (std::size_t k = 0; k < over.size(); ++k) {
    for (std::size_t c = 0; c < search.data.parts[k].channels.size(); ++c) {
      rest[search.data.parts[k].channels[c]] += over[k].col(static_cast<Index>(c)).squaredNorm();
    }
  }
  double duration = 0, step = kInfinity;
  for (std::size_t r = 0; r < records.size(); ++r) {
    const auto& [time, output] = records[r];
    const double length = time[time.size() - 1] - time[0];
    duration = std::max(duration, length);
    step = std::min(step, length / static_cast<double>(time.size() - 1));
    const auto constant = search.fit.amplitudes.row(search.fit.amplitudes.rows() -
                                                    static_cast<Index>(records.size() - r));
    for (Index c = 0; c < scale.size(); ++c) {
      for (const double y : output.row(c)) {
        if (std::isfinite(y)) scale[c] += (y - constant[c]) * (y - constant[c]);
      }
    }
  }
  scale = scale.cwiseMax(1e-300);
  result.explained = 1 - rest.cwiseQuotient(scale).mean();
  std::vector<MeasuredMode> modes;
  Index at = 0;
  for (std::size_t k = 0; k < search.fit.factors.size(); ++k) {
    modes.push_back(to_mode(search, k, at, scale, static_cast<double>(scale.size())));
    modes.back().stability = stability_of(modes.back(), search);
    at += search.fit.factors[k].parameters();
  }
  if (search.larger) doubt_order(search.fit, *search.larger, modes);
  result.order = static_cast<int>(at);
  pair_reals(modes);
  for (const MeasuredMode& mode : modes) {
    MeasuredMode judged = mode;
    judged.reason = doubt(mode, modes, duration, step);
    (judged.reason.empty() ? result.modes : result.rejected).push_back(std::move(judged));
  }
  const auto slower = [](const MeasuredMode& a, const MeasuredMode& b) {
    return a.natural_frequency < b.natural_frequency;
  };
  std::sort(result.modes.begin(), result.modes.end(), slower);
  std::sort(result.rejected.begin(), result.rejected.end(), slower);
  return result;
}

}  // namespace dashpot::analysis
