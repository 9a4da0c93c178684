#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/search/measured_modes.hpp>
#include <dashpot/identification/search/moving_channels.hpp>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dashpot::identification {
namespace {

/// A pole in a model without some part is the same up to this (relative distance, modal assurance
/// criterion).
constexpr double kSamePole = 0.3, kSameShape = 0.5;
/// Two modes a channel, and two that the forces prefer; more orders take long.
constexpr int kOrdersOfChannel = 4, kMostOrders = 40;
/// Student's 95 % quantile for 20 parts over the normal distribution's.
constexpr double kStudent = 2.09 / 1.96;

/// The motion of each pole at all lags: rows are channels by lags, a pair has two columns.
MatrixXd columns_of(const std::vector<RealizedPole>& poles, Index channels, Index lags,
                    double step) {
  MatrixXd columns(channels * lags, 2 * static_cast<Index>(poles.size()));
  Index at = 0;
  for (const RealizedPole& pole : poles) {
    const bool pair = pole.eigenvalue.imag() != 0;
    for (Index k = 0; k < lags; ++k) {
      const VectorXcd y = pole.shape * std::exp(pole.eigenvalue * (static_cast<double>(k) * step));
      columns.col(at).segment(k * channels, channels) = y.real();
      if (pair) columns.col(at + 1).segment(k * channels, channels) = y.imag();
    }
    at += pair ? 2 : 1;
  }
  columns.conservativeResize(Eigen::NoChange, at);
  return columns;
}

/// Least-squares amplitudes: parameters x references.
MatrixXd amplitudes_of(const MatrixXd& columns, const Correlations& correlations) {
  MatrixXd right(columns.rows(), static_cast<Index>(correlations.size()));
  for (std::size_t j = 0; j < correlations.size(); ++j) {
    right.col(static_cast<Index>(j)) = correlations[j].reshaped();
  }
  if (columns.cols() == 0) return {0, right.cols()};  // for which Eigen has no decomposition
  return columns.colPivHouseholderQr().solve(right);
}

/// Returns the residual of other correlations under a model of `order` of some.
double left_over(const Realization& model, int order, const Correlations& own,
                 const Correlations& other, double step) {
  const std::vector<RealizedPole> poles = model.poles(order);
  const Index channels = own[0].rows();
  if (poles.empty()) return squares(other, 0, other[0].cols());
  const MatrixXd columns = columns_of(poles, channels, own[0].cols(), step);
  const MatrixXd amplitudes = amplitudes_of(columns, own);
  double sum = 0;
  for (std::size_t j = 0; j < other.size(); ++j) {
    const VectorXd rest = other[j].reshaped() - columns * amplitudes.col(static_cast<Index>(j));
    sum += rest.squaredNorm();
  }
  return sum;
}

/// The order with which each half of the segments best predicts the other; `left` gets the share of
/// the squares that it does not predict.
int order_of(const AmbientCorrelations& data, int largest, double& left) {
  const Correlations even = data.mean([](std::size_t s) { return s % 2 == 0; });
  const Correlations odd = data.mean([](std::size_t s) { return s % 2 == 1; });
  const Realization of_even(even, data.step, data.delays);
  const Realization of_odd(odd, data.step, data.delays);
  const Index lags = even[0].cols();
  const double all = squares(even, 0, lags) + squares(odd, 0, lags);
  int best = 1;
  left = std::numeric_limits<double>::infinity();
  for (int order = 1; order <= std::min({largest, of_even.max_order(), of_odd.max_order()});
       ++order) {
    const double rest = left_over(of_even, order, even, odd, data.step) +
                        left_over(of_odd, order, odd, even, data.step);
    if (rest < left * all) left = rest / all, best = order;
  }
  return best;
}

/// The spread of an estimate of which each value leaves out one part (Quenouille, Tukey 1958).
double jackknife(const std::vector<double>& values) {
  double mean = 0, sum = 0;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) mean += value / count;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return kStudent * std::sqrt((count - 1) / count * sum);
}

/// A mode of a pole, with the deviations that the poles without each segment show.
MeasuredMode to_mode(const RealizedPole& pole,
                     const std::vector<std::vector<RealizedPole>>& without) {
  MeasuredMode mode;
  const Complex lambda = pole.eigenvalue;
  mode.eigenvalues = {lambda, std::conj(lambda)};
  mode.natural_frequency = modulus(lambda);
  mode.damping_ratio = -lambda.real() / mode.natural_frequency;
  mode.shape = pole.shape;
  std::vector<double> frequencies, ratios;
  for (const std::vector<RealizedPole>& poles : without) {
    const RealizedPole* nearest = nullptr;
    double least = kSamePole * mode.natural_frequency;
    for (const RealizedPole& other : poles) {
      const double distance = std::abs(other.eigenvalue - lambda);
      if (distance < least && likeness(other.shape, pole.shape) > kSameShape) {
        least = distance, nearest = &other;
      }
    }
    if (nearest == nullptr) continue;
    frequencies.push_back(modulus(nearest->eigenvalue));
    ratios.push_back(-nearest->eigenvalue.real() / frequencies.back());
  }
  Evidence evidence{
      .mode = mode,
      .parts = static_cast<double>(frequencies.size()) / static_cast<double>(without.size())};
  weigh(Stage::kParts, evidence, mode);
  if (!mode.reason.empty()) return mode;
  mode.natural_frequency_std = jackknife(frequencies);
  mode.damping_ratio_std =
      lambda.imag() == 0 ? std::numeric_limits<double>::infinity() : jackknife(ratios);
  std::vector<double> sums;
  for (std::size_t k = 0; k < ratios.size(); ++k) {
    sums.push_back(frequencies[k] / mode.natural_frequency + ratios[k]);
  }
  const double w = mode.natural_frequency_std / mode.natural_frequency, z = jackknife(ratios);
  mode.covariance = mode.natural_frequency * (std::pow(jackknife(sums), 2) - w * w - z * z) / 2;
  weigh(Stage::kParts, evidence, mode);
  return mode;
}

}  // namespace

Identification identify_ambient(const std::vector<MotionRecord>& records,
                                const IdentifyOptions& options) {
  check_records(records);
  check_order(options);
  const MovingChannels moving(records);
  const AmbientCorrelations data(moving.records);
  const auto channels = static_cast<int>(data.sizes.size());
  const int largest = options.max_order > 0
                          ? options.max_order
                          : std::min(kOrdersOfChannel * (channels + 1), kMostOrders);
  Identification result;
  result.noise = data.noise;
  const Correlations all = data.mean([](std::size_t) { return true; });
  const Realization model(all, data.step, data.delays);
  check_that(model.max_order() >= 1, "nothing moves");
  double left = 0;
  result.order = order_of(data, std::min(largest, model.max_order()), left);
  result.explained = 1 - left;

  std::vector<std::vector<RealizedPole>> by_order;
  for (int order = 1; order <= std::min(largest, model.max_order()); ++order) {
    by_order.push_back(model.poles(order));
  }
  result.poles = model_poles(by_order);
  std::vector<std::vector<RealizedPole>> without;
  for (std::size_t s = 0; s < data.parts.size(); ++s) {
    without.push_back(
        Realization(data.mean([s](std::size_t k) { return k != s; }), data.step, data.delays)
            .poles(result.order));
  }

  const auto& poles = by_order[static_cast<std::size_t>(result.order) - 1];
  const MatrixXd columns = columns_of(poles, channels, all[0].cols(), data.step);
  const MatrixXd amplitudes = amplitudes_of(columns, all);
  const double motion = squares(all, 0, all[0].cols());
  std::vector<MeasuredMode> modes;
  Index at = 0;
  for (const RealizedPole& pole : poles) {
    const Index width = pole.eigenvalue.imag() != 0 ? 2 : 1;
    modes.push_back(to_mode(pole, without));
    modes.back().stability = stability_of(modes.back(), by_order, result.order);
    modes.back().energy =
        (columns.middleCols(at, width) * amplitudes.middleRows(at, width)).squaredNorm() / motion;
    at += width;
  }
  judge(std::move(modes), {data.duration, data.step}, result);
  for (auto* list : {&result.modes, &result.rejected}) {  // back in the channels' units
    for (MeasuredMode& mode : *list) mode.shape = turned(data.sizes.asDiagonal() * mode.shape);
  }
  for (const SteadyLine& hum : data.hums) {
    result.rejected.push_back(to_mode(hum));
  }
  return moving.of_all(std::move(result));
}

}  // namespace dashpot::identification
