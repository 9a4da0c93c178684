#include <dashpot/identification/motion_verdict.hpp>
#include <dashpot/identification/records/ambient_correlations.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/records/motion_kind.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

namespace dashpot::identification {
namespace {

// Periods are periods of the pace.
constexpr double kMovesMore = 2;      // times its noise: a channel that moves
constexpr Index kPaces = 8;           // of a record, each with a pace of its own,
constexpr Index kShortStretch = 100;  // of more samples than this
constexpr Index kSmooth = 8;          // bins of a spectrum that count together
constexpr double kAboveFloor = 3;     // times the noise's power: bins that count
constexpr double kLastBin = 1e-4;     // rad over half a record: the frequency of a cycle is known
constexpr Index kLagsOfPeriod = 8;    // part of it over which velocities are differences
constexpr Index kFewestBlocks = 20;   // of a period: fewer do not show that motion lasts
constexpr double kLasting = 0.9;   // share of the blocks of motion that lasts with motion in them
constexpr double kFaded = 0.01;    // of the median energy: a block without motion
constexpr double kOutburst = 100;  // times the median: motion that fades from there does not last
// Motion under irregular forces looks alike backwards: its energy rises as often as it falls. After
// a push the energy falls for long, and rises at once.
constexpr double kRisesOften = 0.33;  // share of the blocks
constexpr double kKeepsSize = 10;     // most by which its energy changes from third to third
// A cycle's amplitude stays, within this share, in the second half of a record; a mode that did so
// over as many periods would have a damping ratio below 0.001.
constexpr double kSteadySize = 0.03;
constexpr double kFewestPeriods = 4;  // in that half
constexpr int kHarmonics = 7;
constexpr double kPeriodic =
    0.95;  // share of the motion at the cycle's frequency and its multiples
constexpr double kMainThing = 0.2;  // least share of the record's largest deflection: else a hum

double pace_of_stretch(const MatrixXd& grid, double step, const VectorXd& noise) {
  const Index N = smooth_count(grid.cols() - 1);
  VectorXd sum = VectorXd::Zero(std::max<Index>(1, N / 2 - 1));
  const double width = 2 * std::numbers::pi / (static_cast<double>(N) * step);
  for (Index c = 0; c < grid.rows(); ++c) {
    VectorXd power = difference_power(grid.row(c).head(N + 1).transpose());
    double all = 0;
    for (Index from = 0; from < power.size(); from += kSmooth) {
      const Index count = std::min(kSmooth, power.size() - from);
      const double w = width * (static_cast<double>(from) + 0.5 * static_cast<double>(count + 1));
      const double floor =
          static_cast<double>(N) * std::pow(2 * std::sin(w * step / 2) * noise[c], 2);
      auto bins = power.segment(from, count);
      const double mean = bins.mean();
      bins *= mean > kAboveFloor * floor ? (mean - floor) / mean : 0;
      all += bins.sum();
    }
    if (all > 0) sum += power / all;
  }
  const double half = sum.sum() / 2;
  if (!(half > 0)) return 0;
  Index k = 0;
  for (double below = sum[0]; below < half; below += sum[++k]) continue;
  return width * static_cast<double>(k + 1);
}

/// Least-squares columns of a cycle: a constant, a slope, and its harmonics.
MatrixXd cycle_columns(double w, Index from, Index count) {
  MatrixXd columns(count, 2 + 2 * kHarmonics);
  for (Index i = 0; i < count; ++i) {
    const double phase = w * static_cast<double>(from + i);
    columns(i, 0) = 1;
    columns(i, 1) = static_cast<double>(i) / static_cast<double>(count) - 0.5;
    for (int k = 1; k <= kHarmonics; ++k) {
      columns(i, 2 * k) = std::cos(k * phase);
      columns(i, 2 * k + 1) = std::sin(k * phase);
    }
  }
  return columns;
}

/// The fit of a cycle of `w` (rad a sample) to samples x channels: amplitudes, and residual
/// squares.
struct CycleFit {
  MatrixXd amplitude;
  double rest = 0, motion = 0;

  CycleFit(double w, Index from, const MatrixXd& samples) {
    const MatrixXd columns = cycle_columns(w, from, samples.rows());
    amplitude = columns.colPivHouseholderQr().solve(samples);
    rest = (samples - columns * amplitude).squaredNorm();
    motion = (samples - columns.leftCols(2) * amplitude.topRows(2)).squaredNorm();
  }
  double size() const { return amplitude.middleRows(2, 2).norm(); }
  double all() const { return amplitude.bottomRows(2 * kHarmonics).norm(); }
};

/// The frequency, rad a sample, of the strongest line of samples x channels.
double strongest_line(const MatrixXd& samples) {
  const Index N = smooth_count(samples.rows());
  const MatrixXd used = samples.topRows(N).transpose();
  const ArrayXd power = tapered_power(used.colwise() - VectorXd(used.rowwise().mean()));
  Index top = 0;
  power.tail(power.size() - 1).maxCoeff(&top);
  return 2 * std::numbers::pi * static_cast<double>(top + 1) / static_cast<double>(N);
}

/// Whether the second half of a record repeats itself with one amplitude; its frequency, rad/s.
bool cycles(const MatrixXd& scaled, double step, MotionVerdict& verdict) {
  const Index N = scaled.cols(), half = N / 2, quarter = half / 2;
  if (quarter < 4 * (2 + 2 * kHarmonics)) return false;
  const MatrixXd late = scaled.rightCols(half).transpose();
  double w = strongest_line(late), bin = 2 * std::numbers::pi / static_cast<double>(half);
  if (w * static_cast<double>(half) < kFewestPeriods * 2 * std::numbers::pi ||
      w > std::numbers::pi / 2)
    return false;
  // The frequency with the least residual is searched in a part of the samples, to bound the time.
  const Index stride =
      std::max<Index>(1, static_cast<Index>(std::numbers::pi / (2 * w * (kHarmonics + 1))));
  const MatrixXd few = late(Eigen::seqN(0, half / stride, stride), Eigen::all);
  const auto s = static_cast<double>(stride);
  for (; bin > kLastBin / static_cast<double>(half); bin /= 2) {
    const auto rest = [&](double x) { return CycleFit(x * s, 0, few).rest; };
    const double middle = rest(w);
    if (rest(w - bin) < middle) {
      w -= bin;
    } else if (rest(w + bin) < middle) {
      w += bin;
    }
  }
  const CycleFit fit(w * s, 0, few);
  const VectorXd rest_at = late.colwise().mean();
  const double largest = (scaled.colwise() - rest_at).colwise().norm().maxCoeff();
  if (fit.rest > (1 - kPeriodic) * fit.motion || fit.all() < kMainThing * largest) return false;
  const Index part = few.rows() / 2;
  const CycleFit first(w * s, 0, few.topRows(part)), second(w * s, part, few.bottomRows(part));
  if (std::abs(first.size() - second.size()) > kSteadySize * fit.size()) return false;
  verdict.kind = MotionKind::kLimitCycle;
  verdict.frequency = w / step;
  verdict.harmonics = 1 - std::pow(fit.size() / fit.all(), 2);
  return true;
}

/// Whether something keeps a record's motion up throughout, and irregularly.
bool lasts(const MatrixXd& scaled, Index period) {
  const Index lag = std::max<Index>(1, period / kLagsOfPeriod), block = std::max<Index>(period, 4);
  const Index blocks = (scaled.cols() - lag) / block;
  if (blocks < kFewestBlocks) return false;
  std::vector<double> energy;
  for (Index b = 0; b < blocks; ++b) {
    const auto here = scaled.middleCols(b * block, block);
    energy.push_back((scaled.middleCols(b * block + lag, block) - here).squaredNorm());
  }
  std::vector<double> sorted = energy;
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted[sorted.size() / 2];
  const auto faded = static_cast<std::size_t>((1 - kLasting) * static_cast<double>(blocks));
  if (sorted[faded] < kFaded * median || sorted.back() > kOutburst * median) return false;
  int rises = 0;
  for (std::size_t b = 1; b < energy.size(); ++b) rises += energy[b] > energy[b - 1];
  if (rises < kRisesOften * static_cast<double>(blocks - 1)) return false;
  const auto third = static_cast<std::ptrdiff_t>(energy.size() / 3);
  double first = 0, last = 0;
  for (std::ptrdiff_t b = 0; b < third; ++b) first += energy[static_cast<std::size_t>(b)];
  for (std::ptrdiff_t b = 0; b < third; ++b) last += *(energy.rbegin() + b);
  return first < kKeepsSize * last && last < kKeepsSize * first;
}

}  // namespace

double pace_of(const MatrixXd& grid, double step, const VectorXd& noise) {
  // The median of stretches: a jump has no pace, and spoils one or two of them.
  std::vector<double> paces;
  const Index parts = std::clamp<Index>(grid.cols() / kShortStretch, 1, kPaces);
  const Index length = grid.cols() / parts;
  for (Index at = 0; at + length <= grid.cols(); at += std::max<Index>(1, length / 2)) {
    const double pace = pace_of_stretch(grid.middleCols(at, length), step, noise);
    if (pace > 0) paces.push_back(pace);
  }
  if (paces.empty()) return 0;
  const auto middle = paces.begin() + static_cast<std::ptrdiff_t>(paces.size() / 2);
  std::nth_element(paces.begin(), middle, paces.end());
  return *middle;
}

MotionVerdict judge_motion(const MotionRecord& record) {
  check_records({record});
  MotionVerdict verdict;
  const double step = typical_step({record});
  const VectorXd noise = first_noise({record});
  MatrixXd grid = on_grid(record, step);
  take_steady_lines(grid, step, true);
  const VectorXd mean = grid.rowwise().mean();
  const VectorXd size =
      (grid.colwise() - mean).rowwise().norm() / std::sqrt(static_cast<double>(grid.cols()));
  std::vector<Index> moving;
  for (Index c = 0; c < size.size(); ++c) {
    if (size[c] > kMovesMore * noise[c]) moving.push_back(c);
  }
  if (moving.empty()) return verdict;
  const MatrixXd scaled =
      size(moving).cwiseInverse().asDiagonal() * (grid.colwise() - mean)(moving, Eigen::all);
  const VectorXd scaled_noise = noise(moving).cwiseQuotient(size(moving));
  const double pace = pace_of(scaled, step, scaled_noise);
  if (!(pace > 0)) return verdict;
  verdict.frequency = pace;
  if (cycles(scaled, step, verdict)) return verdict;
  const auto period = static_cast<Index>(std::lround(2 * std::numbers::pi / (pace * step)));
  verdict.kind = lasts(scaled, period) ? MotionKind::kAmbient : MotionKind::kDecays;
  return verdict;
}

}  // namespace dashpot::identification
