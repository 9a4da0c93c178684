#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/tune/place_motion.hpp>
#include <dashpot/controller/settings.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace dashpot::apps {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The transition of (q, q') over a time.
MatrixXd transition_over(const analysis::Response& response, Eigen::Index n, double time) {
  MatrixXd result(2 * n, 2 * n);
  for (Eigen::Index k = 0; k < 2 * n; ++k) {
    const VectorXd unit = VectorXd::Unit(2 * n, k);
    const analysis::Motion moved = response.free(unit.head(n), unit.tail(n), time);
    result.col(k) << moved.position, moved.velocity;
  }
  return result;
}

}  // namespace

Json release_json(const analysis::Response& response, const analysis::Spectrum<>& spectrum,
                  const VectorXd& motion, const Eigen::RowVectorXd& row) {
  double decay = std::numeric_limits<double>::infinity();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    for (const auto& value : mode.eigenvalues) {
      if (std::abs(value) > controller::kSoftFrequency) decay = std::min(decay, -value.real());
    }
  }
  constexpr int kPoints = 401;
  constexpr double kSettled = 0.02;
  const VectorXd rest = VectorXd::Zero(motion.size());
  const auto value_at = [&](double t) { return row.dot(response.free(motion, rest, t).position); };
  const bool grows = decay < 0;
  double horizon = 20;
  if (std::isfinite(decay) && decay != 0) {
    horizon = std::clamp(grows ? -1.5 / decay : 5 / decay, 0.02, 20.0);
  }
  std::vector<double> times(kPoints), values(kPoints);
  int last = 0;
  for (int round = 0; round < 2; ++round) {
    last = 0;
    const MatrixXd step = transition_over(response, motion.size(), horizon / (kPoints - 1));
    VectorXd state(2 * motion.size());
    state << motion, rest;
    for (int i = 0; i < kPoints; ++i, state = step * state) {
      const auto k = static_cast<std::size_t>(i);
      times[k] = horizon * i / (kPoints - 1);
      values[k] = row.dot(state.head(motion.size()));
      if (std::abs(values[k]) > kSettled) last = i;
    }
    if (grows || last > kPoints / 4) break;  // otherwise a slow mode hardly moves this place
    horizon = std::max(3 * times[static_cast<std::size_t>(last) + 1], 0.02);
  }
  const auto lowest = std::min_element(values.begin(), values.end());
  double overshoot = std::max(0.0, -*lowest);
  if (overshoot > 0) {  // between the points, by ternary search
    const auto at = static_cast<std::size_t>(lowest - values.begin());
    double a = times[at == 0 ? 0 : at - 1], b = times[std::min(at + 1, times.size() - 1)];
    for (int i = 0; i < 25; ++i) {
      const double c = a + (b - a) / 3, d = b - (b - a) / 3;
      const bool left = value_at(c) < value_at(d);
      (left ? b : a) = left ? d : c;
    }
    overshoot = std::max(overshoot, -value_at(0.5 * (a + b)));
  }
  Json settling;
  if (!grows && last + 1 < kPoints) {
    double a = times[static_cast<std::size_t>(last)], b = times[static_cast<std::size_t>(last) + 1];
    for (int i = 0; i < 40; ++i) {
      const double c = 0.5 * (a + b);
      (std::abs(value_at(c)) > kSettled ? a : b) = c;
    }
    settling = b;
  }
  return {{"time", times},
          {"value", values},
          {"overshoot", grows ? Json() : Json(overshoot)},
          {"settling_time", settling}};
}

}  // namespace dashpot::apps
