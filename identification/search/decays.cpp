#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/search/measured_modes.hpp>
#include <dashpot/identification/search/model_search.hpp>
#include <dashpot/identification/search/moving_channels.hpp>
#include <dashpot/identification/search/rubbing_decay.hpp>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

namespace dashpot::identification {
namespace {

constexpr double kCritical = 1e-9;  ///< of a frequency: closer eigenvalues have one shape
/// Cells of all records, and of the shortest, beyond which the search is among the beginnings.
constexpr double kSearched = 3000, kShortestSearched = 200;
/// Noise over the sensors' rounding: below this the residual consists of steps. Estimates of it
/// scatter so much.
constexpr double kRounds = 1.2;
/// Noise of one model over the noise of another: below this both explain a motion as well.
constexpr double kAsWell = 1.2;

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
  const double safe = std::abs(d) > kCritical * w ? d : kCritical * w;
  return ((c + s / safe) / 2).cast<Complex>();
}

MeasuredMode to_mode(const FoundModel& found, std::size_t k, Index at, const VectorXd& scale,
                     double all) {
  const DecayFit& fit = found.fit;
  const DecayFactor& factor = fit.factors[k];
  MeasuredMode mode;
  mode.eigenvalues = factor.eigenvalues();
  const std::array<double, 2> shown =
      k < found.scatter.size() ? found.scatter[k] : std::array<double, 2>{};
  const auto variance = [&](Index i) {
    const double more = i - at < 2 ? shown[static_cast<std::size_t>(i - at)] : 0;
    return std::sqrt(std::max(0.0, fit.covariance(i, i)) + std::max(0.0, more));
  };
  if (factor.pair) {
    mode.natural_frequency = std::exp(factor.first);
    mode.natural_frequency_std = mode.natural_frequency * variance(at);
    mode.damping_ratio = factor.second;
    mode.damping_ratio_std = variance(at + 1);
    mode.covariance = mode.natural_frequency * fit.covariance(at, at + 1);
    mode.frequency_scatter = std::pow(mode.natural_frequency, 2) * std::max(0.0, shown[0]);
    mode.ratio_scatter = std::max(0.0, shown[1]);
  } else {
    mode.natural_frequency = std::abs(factor.first);
    mode.natural_frequency_std = variance(at);
    mode.damping_ratio = factor.first < 0 ? 1 : -1;
    mode.damping_ratio_std = std::numeric_limits<double>::infinity();
  }
  mode.energy = squares_of(found.data, factor_motion(found.data, fit, k), scale) / all;
  mode.shape = turned(shape_of(factor, fit.amplitudes.middleRows(at, factor.parameters())));
  return mode;
}

/// Adds the difference to the next larger model to the variances, because the number of modes is
/// uncertain too.
void doubt_order(const DecayFit& fit, const DecayFit& larger, std::vector<MeasuredMode>& modes) {
  for (std::size_t k = 0; k < modes.size(); ++k) {
    if (!fit.factors[k].pair) continue;
    const DecayFactor* nearest = nullptr;
    double least = std::numeric_limits<double>::infinity();
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

/// Returns the sum of squares of each channel about its mean.
VectorXd squares_of_motion(const MotionRecord& record) {
  VectorXd squares = VectorXd::Zero(record.output.rows());
  for (Index c = 0; c < squares.size(); ++c) {
    const auto there = record.output.row(c).array().isFinite();
    const auto y = there.select(record.output.row(c).array(), 0);
    const auto count = static_cast<double>(there.count());
    squares[c] = there.select(y - y.sum() / std::max(1.0, count), 0).square().sum();
  }
  return squares;
}

Identification describe(const FoundModel& found, const std::vector<MotionRecord>& records) {
  Identification result;
  result.noise = found.fit.noise;
  result.whiteness = found.fit.whiteness;
  result.poles = model_poles(found.by_order);

  // The motion of each channel about its means, and its residual. The model's constants are not
  // rest positions if a slow decay cancels against them.
  VectorXd scale = VectorXd::Zero(found.data.channels), rest = scale;
  const auto over = left_over(found.data, found.fit);
  for (std::size_t k = 0; k < over.size(); ++k) {
    for (std::size_t c = 0; c < found.data.parts[k].channels.size(); ++c) {
      rest[found.data.parts[k].channels[c]] += over[k].col(static_cast<Index>(c)).squaredNorm();
    }
  }
  double duration = 0, step = std::numeric_limits<double>::infinity();
  for (const MotionRecord& record : records) {
    const double length = record.time[record.time.size() - 1] - record.time[0];
    duration = std::max(duration, length);
    step = std::min(step, length / static_cast<double>(record.time.size() - 1));
    scale += squares_of_motion(record);
  }
  scale = scale.cwiseMax(kTiny);
  result.explained = 1 - rest.cwiseQuotient(scale).mean();
  std::vector<MeasuredMode> modes;
  Index at = 0;
  for (std::size_t k = 0; k < found.fit.factors.size(); ++k) {
    modes.push_back(to_mode(found, k, at, scale, static_cast<double>(scale.size())));
    modes.back().stability = stability_of(modes.back(), found.by_order, found.order);
    at += found.fit.factors[k].parameters();
  }
  if (found.larger) doubt_order(found.fit, *found.larger, modes);
  result.order = static_cast<int>(at);
  for (const DecayFactor& factor : found.not_repeated) {
    MeasuredMode& mode = modes.emplace_back();
    mode.eigenvalues = factor.eigenvalues();
    mode.natural_frequency = factor.pair ? std::exp(factor.first) : std::abs(factor.first);
    mode.damping_ratio = factor.pair ? factor.second : 1;
    mode.shape = VectorXcd::Zero(found.data.channels);
    weigh(Stage::kNotRepeated, {mode}, mode);
  }
  const RecordFacts facts{
      .duration = duration,
      .step = step,
      .kind = found.data.inputs == 0 ? MotionKind::kDecays : MotionKind::kDriven,
      .records = found.data.records,
      .whiteness = result.whiteness,
      .unexplained = 1 - result.explained,
      .rounded = (found.fit.noise.array() <= kRounds * found.data.rounding.array()).all(),
      .differs = found.differs};
  judge(std::move(modes), facts, result);
  return result;
}

}  // namespace

Identification identify_decays(const std::vector<MotionRecord>& records,
                               const IdentifyOptions& options) {
  check_records(records);
  check_order(options);
  MovingChannels moving(records);
  std::vector<SteadyLine> hums;
  for (MotionRecord& record : moving.records) {
    for (SteadyLine& hum : take_hums(record)) hums.push_back(std::move(hum));
  }
  Identification result = describe(find_model(moving.records, options), moving.records);
  for (const SteadyLine& hum : hums) result.rejected.push_back(to_mode(hum));
  if (moving.channels.size() == 1 && options.refine) {
    const auto rubbing = identify_rubbing(MovingChannels(records).records);
    if (rubbing && !rubbing->modes.empty()) {
      result = *rubbing;
    } else if (rubbing && result.order > 2 && rubbing->noise[0] < kAsWell * result.noise[0]) {
      for (MeasuredMode& mode : result.modes) {
        mode.reason = "friction explains the motion as well, and too few turns tell";
        mode.not_linear = true;
        result.rejected.push_back(std::move(mode));
      }
      result.modes.clear();
    }
  }
  return moving.of_all(std::move(result));
}

Identification identify_excited(const std::vector<MotionRecord>& records,
                                const IdentifyOptions& options) {
  check_records(records);
  check_order(options);
  check_that(records.front().input.rows() > 0, "the records have no inputs");
  const MovingChannels moving(records);
  const ExcitedCells cells(moving.records);
  Index count = 0, shortest = std::numeric_limits<Index>::max();
  for (const MotionRecord& record : cells.records) {
    count += record.time.size();
    shortest = std::min(shortest, record.time.size());
  }
  const double share = std::max(kSearched / static_cast<double>(count),
                                kShortestSearched / static_cast<double>(shortest));
  if (share >= 1) return moving.of_all(describe(find_model(cells, options), cells.records));
  std::vector<MotionRecord> beginnings;
  for (const MotionRecord& record : moving.records) {
    const auto samples = static_cast<double>(record.time.size());
    beginnings.push_back(part_of(record, 0, static_cast<Index>(share * samples)));
  }
  const ExcitedCells some(beginnings);
  FoundModel found = find_model(some, options);
  refine(cells, found);
  return moving.of_all(describe(found, cells.records));
}

}  // namespace dashpot::identification
