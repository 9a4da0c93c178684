#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <unsupported/Eigen/FFT>
#include <utility>

namespace dashpot::identification {
namespace {

constexpr Index kNear = 30;          // bins of the spectrum to each side
constexpr Index kLeak = 3;           // bins to each side that a line leaks into
constexpr Index kNeeded = 16;        // times kNear: samples in which a line is looked for
constexpr double kOfBin = 1e-3;      // precision of its frequency
constexpr double kOutstanding = 20;  // times their median
constexpr Index kSteadyParts = 8;
constexpr double kSteady = 0.7;      // of irregular motion, two in ten thousand reach it
constexpr double kSteadyHum = 0.95;  // in the second half of a decay
constexpr int kMostLines = 20;

/// The bin that stands out most; -1 if none does.
Index outstanding(const ArrayXd& power, const std::vector<bool>& tried) {
  Index best = -1;
  double most = kOutstanding;
  std::vector<double> near;
  for (Index k = kLeak; k + kLeak < power.size(); ++k) {
    if (tried[static_cast<std::size_t>(k)] || power[k] < power[k - 1] || power[k] < power[k + 1]) {
      continue;
    }
    near.clear();
    for (Index j = std::max<Index>(1, k - kNear); j < std::min(power.size(), k + kNear + 1); ++j) {
      if (std::abs(j - k) > kLeak) near.push_back(power[j]);
    }
    const auto middle = near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2);
    std::nth_element(near.begin(), middle, near.end());
    if (power[k] > most * *middle) most = power[k] / *middle, best = k;
  }
  return best;
}

/// exp(-i w t) at the samples.
VectorXcd turning(double w, double step, Index samples) {
  VectorXcd result(samples);
  for (Index i = 0; i < samples; ++i) {
    result[i] = std::polar(1.0, -w * step * static_cast<double>(i));
  }
  return result;
}

/// The frequency within a bin to each side at which the tapered spectrum is largest, by golden
/// sections.
double refined(const MatrixXd& scaled, double w, double bin, double step) {
  const Index N = scaled.cols();
  const MatrixXd tapered = scaled * taper_of(N).matrix().asDiagonal();
  const auto size = [&](double x) { return (tapered * turning(x, step, N)).squaredNorm(); };
  constexpr double kGolden = 0.6180339887498949;
  double a = w - bin, b = w + bin;
  double x = b - kGolden * (b - a), y = a + kGolden * (b - a);
  double at_x = size(x), at_y = size(y);
  while (b - a > kOfBin * bin) {
    if (at_x > at_y) {
      b = y, y = x, at_y = at_x;
      at_x = size(x = b - kGolden * (b - a));
    } else {
      a = x, x = y, at_x = at_y;
      at_y = size(y = a + kGolden * (b - a));
    }
  }
  return (a + b) / 2;
}

/// The motion at frequency `w` in parts of the record, channels x parts.
MatrixXcd amplitudes_of(const MatrixXd& scaled, double w, double step) {
  const Index length = scaled.cols() / kSteadyParts;
  const VectorXcd turns = turning(w, step, scaled.cols());
  const ArrayXd taper = taper_of(length);
  MatrixXcd amplitudes(scaled.rows(), kSteadyParts);
  for (Index p = 0; p < kSteadyParts; ++p) {
    amplitudes.col(p) = scaled.middleCols(p * length, length) *
                        (turns.segment(p * length, length).array() * taper).matrix();
  }
  return amplitudes * (4 / static_cast<double>(length));  // the taper's mean is a half
}

/// Share of amplitudes in parts of a record that has one phase, 0 to 1.
double steadiness(const MatrixXcd& amplitudes) {
  const double all = amplitudes.squaredNorm();
  return all > 0 ? amplitudes.rowwise().sum().squaredNorm() /
                       (static_cast<double>(amplitudes.cols()) * all)
                 : 0;
}

/// Whether a line has one amplitude in the second half of the record, where a decay fades, and is
/// small beside the motion.
bool is_hum(const MatrixXd& scaled, const MatrixXcd& amplitudes) {
  constexpr double kLevel = 0.15, kSmall = 0.1;
  const auto size = [&](Index from) {
    return amplitudes.middleCols(from, kSteadyParts / 4).rowwise().sum().norm() / 2;
  };
  const double early = size(kSteadyParts / 2), late = size(3 * kSteadyParts / 4);
  const Index last = scaled.cols() / kSteadyParts;
  const VectorXd rest = scaled.rightCols(last).rowwise().mean();
  return std::abs(early - late) < kLevel * late &&
         late < kSmall * (scaled.colwise() - rest).colwise().norm().maxCoeff();
}

}  // namespace

std::vector<SteadyLine> take_steady_lines(MatrixXd& grid, double step, bool of_decays) {
  std::vector<SteadyLine> lines;
  if (grid.cols() < kNeeded * kNear) return lines;
  const VectorXd mean = grid.rowwise().mean();
  const VectorXd sizes =
      ((grid.colwise() - mean).rowwise().norm()).cwiseMax(std::numeric_limits<double>::min());
  MatrixXd scaled = sizes.cwiseInverse().asDiagonal() * (grid.colwise() - mean);
  ArrayXd power = tapered_power(scaled);
  std::vector<bool> tried(static_cast<std::size_t>(power.size()));
  const double bin = std::numbers::pi / (static_cast<double>(power.size()) * step);
  while (static_cast<int>(lines.size()) < kMostLines) {
    const Index k = outstanding(power, tried);
    if (k < 0) break;
    tried[static_cast<std::size_t>(k)] = true;
    const double w = refined(scaled, bin * static_cast<double>(k), bin, step);
    const MatrixXcd parts = amplitudes_of(scaled, w, step);
    const bool steady = of_decays ? is_hum(scaled, parts) &&
                                        steadiness(parts.rightCols(kSteadyParts / 2)) > kSteadyHum
                                  : steadiness(parts) >= kSteady;
    if (!steady) continue;
    const VectorXcd turns = turning(w, step, grid.cols());
    MatrixXd waves(grid.cols(), 2);
    waves << turns.real(), turns.imag();
    // Tapered, because at the ends of a record other motion looks like the line.
    const MatrixXd weighted = taper_of(grid.cols()).matrix().asDiagonal() * waves;
    const MatrixXd shares =
        (weighted.transpose() * waves).ldlt().solve(weighted.transpose() * scaled.transpose());
    scaled -= (waves * shares).transpose();
    lines.push_back({w, VectorXcd(grid.rows())});
    lines.back().size.real() = sizes.cwiseProduct(shares.row(0).transpose());
    lines.back().size.imag() = sizes.cwiseProduct(shares.row(1).transpose());
    power = tapered_power(scaled);
  }
  if (!lines.empty()) grid = (sizes.asDiagonal() * scaled).colwise() + mean;
  return lines;
}

std::vector<SteadyLine> take_hums(MotionRecord& record) {
  const double step = typical_step({record});
  MatrixXd grid = on_grid(record, step);
  std::vector<SteadyLine> hums = take_steady_lines(grid, step, true);
  for (const SteadyLine& hum : hums) {
    for (Index i = 0; i < record.time.size(); ++i) {
      const Complex turn = std::polar(1.0, hum.frequency * (record.time[i] - record.time[0]));
      record.output.col(i) -= (hum.size * turn).real();
    }
  }
  return hums;
}

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
