#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <unsupported/Eigen/FFT>
#include <utility>

namespace dashpot::identification {
namespace {

constexpr Index kParts = 20;         // the standard deviations are theirs
constexpr Index kMostRows = 300;     // of the Hankel matrix
constexpr Index kMostLags = 600;     // correlations looked at
constexpr double kVelocity = 0.98;   // share of the velocities' squares within the band
constexpr double kCellsPerHalf = 3;  // cells in half a period of the end of the band
constexpr double kAudible = 2.5;     // standard errors of a correlation that is used
constexpr Index kLargestWindow = 4096;
constexpr double kLongGap = 20;         // samples
constexpr Index kShortPiece = 20;       // samples: nothing is to be seen in fewer
constexpr Index kFewestLags = 8;        // of a third of a part: two modes in one channel
constexpr double kAboveNoise = 1.5;     // times its power: what stands out of its spectrum
constexpr double kLeastMotion = 1e-10;  // of a channel, relative to its mean

/// Frequency below which nearly all of the velocities beyond noise lie, rad/s (Welch 1967).
double band_of(const std::vector<MatrixXd>& grids, double step, const VectorXd& noise) {
  Index longest = 0;
  for (const MatrixXd& grid : grids) longest = std::max(longest, grid.cols());
  Index window = kLargestWindow;
  while (window > longest / 4) window /= 2;
  const VectorXd taper =
      (VectorXd::LinSpaced(window, 0, 2 * std::numbers::pi).array().cos() * -0.5 + 0.5).matrix();
  MatrixXd power = MatrixXd::Zero(window / 2 + 1, grids[0].rows());
  double count = 0;
  Eigen::FFT<double> fft;
  VectorXcd spectrum;
  for (const MatrixXd& grid : grids) {
    for (Index at = 0; at + window <= grid.cols(); at += window / 2, ++count) {
      for (Index c = 0; c < grid.rows(); ++c) {
        const VectorXd part = grid.row(c).segment(at, window);
        const VectorXd shown = ((part.array() - part.mean()) * taper.array()).matrix();
        fft.fwd(spectrum, shown);
        power.col(c) += spectrum.head(power.rows()).cwiseAbs2();
      }
    }
  }
  power /= count * taper.squaredNorm();
  const double w = 2 * std::numbers::pi / (static_cast<double>(window) * step);
  double band = 0;
  for (Index c = 0; c < power.cols(); ++c) {
    const double floor = kAboveNoise * noise[c] * noise[c];
    VectorXd sum(power.rows());
    double velocity = 0;
    for (Index k = 0; k < sum.size(); ++k) {
      const double kk = static_cast<double>(k);
      sum[k] = velocity += std::max(0.0, power(k, c) - floor) * kk * kk;
    }
    const auto end = std::lower_bound(sum.begin(), sum.end(), kVelocity * velocity);
    band = std::max(band, w * static_cast<double>(end - sum.begin()));
  }
  return std::max(band, w);
}

/// The records without their long gaps, and without pieces much shorter than a part.
std::vector<MotionRecord> unbroken(const std::vector<MotionRecord>& records, double sample) {
  std::vector<MotionRecord> pieces;
  Index samples = 0;
  for (const MotionRecord& record : records) {
    const auto take = [&](Index from, Index to) {
      if (to > from) pieces.push_back(part_of(record, from, to)), samples += to - from;
    };
    Index from = 0, last = -1;  // sample with all channels
    for (Index i = 0; i < record.time.size(); ++i) {
      if (!record.output.col(i).allFinite()) continue;
      if (last < 0) from = i;
      if (last >= 0 && record.time[i] - record.time[last] > kLongGap * sample) {
        take(from, last + 1);
        from = i;
      }
      last = i;
    }
    take(from, last + 1);
  }
  const Index least = std::max<Index>(kShortPiece, samples / (2 * kParts));
  std::erase_if(pieces, [least](const MotionRecord& piece) { return piece.time.size() < least; });
  return pieces;
}

void require_length(bool enough, Index length) {
  if (enough) return;
  throw std::invalid_argument(
      "identify: motion under unknown forces takes a longer record to show anything: " +
      std::to_string(length * kParts) + " samples at its pace, need " +
      std::to_string(3 * kFewestLags * kParts));
}

/// Means of `cell` samples each, about the record's mean, in units of the channels' `sizes`.
MatrixXd cells_of(const MatrixXd& grid, Index cell, const VectorXd& sizes) {
  MatrixXd cells(grid.rows(), grid.cols() / cell);
  for (Index k = 0; k < cells.cols(); ++k) {
    cells.col(k) = grid.middleCols(k * cell, cell).rowwise().mean();
  }
  const VectorXd mean = cells.rowwise().mean();
  return sizes.cwiseInverse().asDiagonal() * (cells.colwise() - mean);
}

/// At most `count` rising delays below `reach`: all, or half of them dense, for what is fast, and
/// pairs ever further apart.
std::vector<Index> delays_to(Index reach, Index count) {
  const Index dense = reach > count ? count / 2 : reach, pairs = (count - dense) / 2;
  std::vector<Index> delays;
  for (Index k = 0; k < dense; ++k) delays.push_back(k);
  if (dense == reach) return delays;
  const double growth = static_cast<double>(reach - 1) / static_cast<double>(dense);
  for (Index k = 1; k <= pairs; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(pairs);
    const auto far = static_cast<Index>(static_cast<double>(dense) * std::pow(growth, share));
    delays.push_back(std::max(delays.back() + 1, far - 1));
    delays.push_back(delays.back() + 1);
  }
  return delays;
}

Correlations correlations_of(const MatrixXd& cells, Index lags) {
  Correlations result(static_cast<std::size_t>(cells.rows()), MatrixXd(cells.rows(), lags));
  for (Index k = 1; k <= lags; ++k) {
    const Index N = cells.cols() - k;
    const MatrixXd R = cells.rightCols(N) * cells.leftCols(N).transpose() / static_cast<double>(N);
    for (Index j = 0; j < R.cols(); ++j) result[static_cast<std::size_t>(j)].col(k - 1) = R.col(j);
  }
  return result;
}

}  // namespace

double squares(const Correlations& a, Index first, Index count) {
  double sum = 0;
  for (const MatrixXd& m : a) sum += m.middleCols(first, count).squaredNorm();
  return sum;
}

AmbientCorrelations::AmbientCorrelations(const std::vector<MotionRecord>& records) {
  const double sample = typical_step(records);
  noise = first_noise(records);
  std::vector<MatrixXd> grids;
  Index samples = 0, shortest = std::numeric_limits<Index>::max();
  for (const MotionRecord& record : unbroken(records, sample)) {
    grids.push_back(on_grid(record, sample));
    for (SteadyLine& line : take_steady_lines(grids.back(), sample)) {
      hums.push_back(std::move(line));
    }
    samples += grids.back().cols();
    shortest = std::min(shortest, grids.back().cols());
    const auto& time = record.time;
    duration = std::max(duration, time[time.size() - 1] - time[0]);
  }
  require_length(!grids.empty(), 0);
  const auto cell = std::max<Index>(
      1, static_cast<Index>(std::numbers::pi / (kCellsPerHalf * band_of(grids, sample, noise)) /
                            sample));
  step = static_cast<double>(cell) * sample;
  sizes = VectorXd::Zero(grids[0].rows());
  VectorXd least = VectorXd::Constant(sizes.size(), kTiny);
  for (const MatrixXd& grid : grids) {
    const VectorXd mean = grid.rowwise().mean();
    sizes += (grid.colwise() - mean).rowwise().squaredNorm();
    least = least.cwiseMax(kLeastMotion * mean.cwiseAbs());
  }
  sizes = (sizes / static_cast<double>(samples)).cwiseSqrt().cwiseMax(least);

  const Index length = std::min(samples / kParts, shortest) / cell;
  const Index lags = std::min(length / 3, kMostLags);
  require_length(lags >= kFewestLags, length);
  for (const MatrixXd& grid : grids) {
    const MatrixXd cells = cells_of(grid, cell, sizes);
    for (Index at = 0; at + length <= cells.cols(); at += length) {
      parts.push_back(correlations_of(cells.middleCols(at, length), lags));
    }
  }
  shorten(lags);
}

/// To the lags at which the correlations stand out from their standard errors.
void AmbientCorrelations::shorten(Index lags) {
  const Correlations all = mean([](std::size_t) { return true; });
  Correlations spread(all.size(), MatrixXd::Zero(all[0].rows(), lags));
  for (const Correlations& part : parts) {
    for (std::size_t j = 0; j < all.size(); ++j) {
      spread[j] += (part[j] - all[j]).cwiseAbs2();
    }
  }
  const auto count = static_cast<double>(parts.size());
  Index last = 0;
  for (Index k = 0; k < lags; ++k) {
    double error = 0;
    for (const MatrixXd& m : spread) error += m.col(k).sum() / (count * (count - 1));
    if (squares(all, k, 1) > kAudible * kAudible * error) last = k;
  }
  delays = delays_to(std::max<Index>(4, (last + 1) / 2),
                     std::max<Index>(kFewestLags, kMostRows / all[0].rows()));
  const Index used = 2 * delays.back() + 1;
  for (Correlations& part : parts) {
    for (MatrixXd& m : part) m.conservativeResize(Eigen::NoChange, std::min(lags, used));
  }
}

}  // namespace dashpot::identification
