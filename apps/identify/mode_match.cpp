#include <dashpot/apps/identify/mode_match.hpp>
#include <dashpot/apps/report/mode_pairs.hpp>

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

/// The eigenvalue of an underdamped mode; for other modes a point of equal size on the real axis.
Complex eigenvalue(double frequency, double ratio) {
  return frequency * Complex(-ratio, std::sqrt(std::max(0.0, 1 - ratio * ratio)));
}

/// The distance between a measured and a predicted mode; infinite if they cannot be the same.
double unlikeness(const MeasuredMode& measured, const PredictedMode& predicted, double alike) {
  const Complex a = eigenvalue(measured.natural_frequency, measured.damping_ratio);
  const Complex b = eigenvalue(predicted.natural_frequency, predicted.damping_ratio);
  const double distance = std::abs(a - b) / std::max(std::abs(a), std::abs(b));
  if (distance > 0.4 || alike < 0.5) return std::numeric_limits<double>::infinity();
  return distance + (1 - alike);
}

constexpr double kFarthest = 0.9;  // above the largest finite unlikeness

}  // namespace

void match(const std::vector<MeasuredMode>& measured, std::vector<PredictedMode>& predicted) {
  const auto rows = static_cast<Eigen::Index>(predicted.size());
  Eigen::MatrixXd alike(rows, static_cast<Eigen::Index>(measured.size()));
  Eigen::MatrixXd apart = alike;
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index k = 0; k < alike.cols(); ++k) {
      const MeasuredMode& mode = measured[static_cast<std::size_t>(k)];
      const PredictedMode& other = predicted[static_cast<std::size_t>(i)];
      alike(i, k) = likeness(mode.shape, other.shape);
      apart(i, k) = unlikeness(mode, other, alike(i, k));
    }
  }
  const std::vector<int> partner = nearest_pairs(apart, kFarthest);
  for (std::size_t i = 0; i < predicted.size(); ++i) {
    predicted[i].measured = partner[i];
    if (partner[i] >= 0) predicted[i].likeness = alike(static_cast<Eigen::Index>(i), partner[i]);
  }
}

void put_in_order(const std::vector<PredictedMode>& others, std::vector<PredictedMode>& modes) {
  if (others.size() != modes.size()) return;
  const auto count = static_cast<Eigen::Index>(modes.size());
  Eigen::MatrixXd apart(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index k = 0; k < count; ++k) {
      apart(i, k) = 1 - likeness(others[static_cast<std::size_t>(k)].shape,
                                 modes[static_cast<std::size_t>(i)].shape);
    }
  }
  const std::vector<int> place = nearest_pairs(apart, 2);
  if (std::find(place.begin(), place.end(), -1) != place.end()) return;  // shapes have NaN
  std::vector<PredictedMode> ordered(modes.size());
  for (std::size_t i = 0; i < modes.size(); ++i) {
    ordered[static_cast<std::size_t>(place[i])] = std::move(modes[i]);
  }
  modes = std::move(ordered);
}

}  // namespace dashpot::apps
