#include <dashpot/apps/identify/mode_match.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dashpot::apps {
namespace {

using analysis::Complex;
using identification::MeasuredMode;

double likeness(const Eigen::VectorXcd& u, const Eigen::VectorXcd& v) {
  return std::norm(u.dot(v)) / std::max(1e-300, u.squaredNorm() * v.squaredNorm());
}

/// The eigenvalue of an underdamped mode; of others a point that is as far on the axis.
Complex eigenvalue(double frequency, double ratio) {
  return frequency * Complex(-ratio, std::sqrt(std::max(0.0, 1 - ratio * ratio)));
}

/// How unlike a measured and a predicted mode are; infinite if they cannot be one.
double unlikeness(const MeasuredMode& measured, const PredictedMode& predicted, double alike) {
  const Complex a = eigenvalue(measured.natural_frequency, measured.damping_ratio);
  const Complex b = eigenvalue(predicted.natural_frequency, predicted.damping_ratio);
  const double distance = std::abs(a - b) / std::max(std::abs(a), std::abs(b));
  if (distance > 0.4 || alike < 0.5) return std::numeric_limits<double>::infinity();
  return distance + (1 - alike);
}

/// Pairs `count` things with some of `others` things, those of least distance(i, k) first. Returns
/// each one's partner; -1 where only infinite distances are left.
template <class Distance>
std::vector<int> pairs(std::size_t count, std::size_t others, const Distance& distance) {
  std::vector<int> partner(count, -1);
  std::vector<bool> used(others);
  for (;;) {
    double least = std::numeric_limits<double>::infinity();
    std::size_t from = 0, to = 0;
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < others && partner[i] < 0; ++k) {
        const double there = used[k] ? least : distance(i, k);
        if (there < least) least = there, from = i, to = k;
      }
    }
    if (std::isinf(least)) return partner;
    partner[from] = static_cast<int>(to);
    used[to] = true;
  }
}

}  // namespace

void match(const std::vector<MeasuredMode>& measured, std::vector<PredictedMode>& predicted) {
  const auto alike = [&](std::size_t i, std::size_t k) {
    return likeness(measured[k].shape, predicted[i].shape);
  };
  const std::vector<int> partner =
      pairs(predicted.size(), measured.size(), [&](std::size_t i, std::size_t k) {
        return unlikeness(measured[k], predicted[i], alike(i, k));
      });
  for (std::size_t i = 0; i < predicted.size(); ++i) {
    predicted[i].measured = partner[i];
    if (partner[i] >= 0) predicted[i].likeness = alike(i, static_cast<std::size_t>(partner[i]));
  }
}

void put_in_order(const std::vector<PredictedMode>& others, std::vector<PredictedMode>& modes) {
  if (others.size() != modes.size()) return;
  const std::vector<int> place = pairs(
      modes.size(), others.size(),
      [&](std::size_t i, std::size_t k) { return 1 - likeness(others[k].shape, modes[i].shape); });
  if (std::find(place.begin(), place.end(), -1) != place.end()) return;  // shapes are no numbers
  std::vector<PredictedMode> ordered(modes.size());
  for (std::size_t i = 0; i < modes.size(); ++i) {
    ordered[static_cast<std::size_t>(place[i])] = std::move(modes[i]);
  }
  modes = std::move(ordered);
}

}  // namespace dashpot::apps
