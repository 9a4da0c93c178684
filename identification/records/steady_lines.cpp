#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>
#include <dashpot/identification/records/steady_lines.hpp>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/FFT>

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

}  // namespace dashpot::identification
