#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dashpot::identification {
namespace {

constexpr Index kCellsOfAll = 600, kFewCells = 100, kManyCells = 300;
/// Cells of a record; each of many records has fewer.
Index usual_cells(std::size_t records) {
  return std::clamp<Index>(kCellsOfAll / static_cast<Index>(records), kFewCells, kManyCells);
}

constexpr Index kEnd = 10;  // part of a record at its end, where it rests
constexpr Index kStretchesHeard = 50, kLeastHeard = 20;  // of a record, and samples of it
// Squares of audible motion, in units of the noise: not quite white, and beyond chance.
constexpr double kMuchNoise = 1.5, kSurely = 5;
constexpr double kWindowsOfWidth = 1.5;  // as many windows tell the least singular values
constexpr double kQuiet = 0.9, kQuietDeviations = 1.645;  // share of normal noise within them
constexpr double kOfWhole = 1e-12;    // of a length: rounding leaves no point out
constexpr double kDigits = 1e-13;     // of the largest sample: no noise is less
constexpr double kWideGap = 2.5;      // steps
constexpr double kOversampled = 1.5;  // cells in half a period, at least
constexpr double kBand = 0.02;        // of all frequencies: lines of a spectrum that count together

/// The value below which this share of them lies.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

VectorXd end_of(const MatrixXd& grid) {
  const Index tenth = std::max<Index>(1, grid.cols() / kEnd);
  return grid.rightCols(tenth).rowwise().mean();
}

/// The noise of evenly spaced samples by the least singular values of their Hankel matrix: motion
/// that is predictable from sample to sample leaves them alone, however far apart samples are.
double unpredictable(const MotionRecord& record, Index channel) {
  constexpr Index kWindow = 40, kMostWindows = 1500;
  const auto y = record.output.row(channel);
  const Index N = y.size(), width = std::min(kWindow, N / 3);
  if (width < 4) return std::numeric_limits<double>::infinity();
  MatrixXd covariance = MatrixXd::Zero(width, width);
  const Index stride = std::max<Index>(1, N / kMostWindows);
  double count = 0;
  for (Index at = 0; at + width <= N; at += stride) {
    const VectorXd window = y.segment(at, width).transpose();
    if (!window.allFinite()) continue;
    covariance.selfadjointView<Eigen::Lower>().rankUpdate(VectorXd(window.array() - window.mean()));
    ++count;
  }
  if (count < kWindowsOfWidth * static_cast<double>(width))
    return std::numeric_limits<double>::infinity();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(covariance / count, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[1 + 2 * width / 5]));
}

}  // namespace

Index audible(const MatrixXd& grid, const VectorXd& noise) {
  const MatrixXd y = noise.cwiseInverse().asDiagonal() * (grid.colwise() - end_of(grid));
  const Index window = std::max<Index>(1, grid.cols() / kStretchesHeard);
  const double samples = static_cast<double>(window * grid.rows());
  const double least = kMuchNoise + kSurely * std::sqrt(2 / samples);
  Index last = 0;
  for (Index at = 0; at + window <= grid.cols(); at += window) {
    if (y.middleCols(at, window).squaredNorm() / samples > least) last = at + window;
  }
  return std::max(last, std::min(grid.cols(), kLeastHeard));
}

double typical_step(const std::vector<MotionRecord>& records) {
  std::vector<double> steps;
  for (const MotionRecord& record : records) {
    for (Index i = 1; i < record.time.size(); ++i)
      steps.push_back(record.time[i] - record.time[i - 1]);
  }
  return quantile(std::move(steps), 0.5);
}

MatrixXd on_grid(const MotionRecord& record, double step, MatrixXd* widths) {
  const VectorXd& time = record.time;
  const double length = time[time.size() - 1] - time[0];
  const auto N = static_cast<Index>(std::floor(length / step * (1 + kOfWhole))) + 1;
  MatrixXd grid(record.output.rows(), N);
  if (widths != nullptr) widths->resizeLike(grid);
  for (Index c = 0; c < grid.rows(); ++c) {
    Index left = -1, right = 0;  // samples that are there, on both sides
    const auto there = [&](Index i) { return std::isfinite(record.output(c, i)); };
    while (!there(right)) ++right;
    left = right;
    for (Index k = 0; k < N; ++k) {
      const double t = time[0] + static_cast<double>(k) * step;
      while (time[right] < t) {
        Index next = right + 1;
        while (next < time.size() && !there(next)) ++next;
        if (next == time.size()) break;
        left = right;
        right = next;
      }
      const double width = time[right] - time[left];
      if (widths != nullptr) (*widths)(c, k) = width;
      const double share = width > 0 ? std::clamp((t - time[left]) / width, 0.0, 1.0) : 1.0;
      grid(c, k) =
          record.output(c, left) + share * (record.output(c, right) - record.output(c, left));
    }
  }
  return grid;
}

VectorXd first_noise(const std::vector<MotionRecord>& records, VectorXd* steps) {
  const Index channels = records.front().output.rows();
  VectorXd noise(channels);
  if (steps != nullptr) steps->setZero(channels);
  for (Index c = 0; c < channels; ++c) {
    std::vector<double> differences;
    double largest = 0, quantum = std::numeric_limits<double>::infinity(),
           hankel = std::numeric_limits<double>::infinity();
    for (const MotionRecord& record : records) {
      const auto y = record.output.row(c);
      for (Index i = 0; i < y.size(); ++i) {
        if (std::isfinite(y[i])) largest = std::max(largest, std::abs(y[i]));
        const double change = i > 0 ? std::abs(y[i] - y[i - 1]) : 0;
        if (change > 0) quantum = std::min(quantum, change);
        if (i < 5) continue;
        const double d =
            y[i] - 5 * y[i - 1] + 10 * y[i - 2] - 10 * y[i - 3] + 5 * y[i - 4] - y[i - 5];
        if (std::isfinite(d)) differences.push_back(std::abs(d));
      }
      hankel = std::min(hankel, unpredictable(record, c));
    }
    // Pushes are in the last tenth.
    constexpr double kGain = 15.874507866387544;  // root of the coefficients' squares, 252
    const double size = quantile(std::move(differences), kQuiet) / kQuietDeviations / kGain;
    // Differences of samples far apart contain motion. Digits are at least the least step apart.
    const double seen = hankel < size / 2 ? hankel : size;
    const double digit = std::isfinite(quantum) ? quantum / std::sqrt(12.0) : 0;
    noise[c] = std::max({seen, digit, kDigits * largest, kTiny});
    if (steps != nullptr && digit > seen) (*steps)[c] = digit;
  }
  return noise;
}

DecayCells::DecayCells(const std::vector<MotionRecord>& motions, const VectorXd& sample_noise,
                       const VectorXd& lost, Index most) {
  const double fine = typical_step(motions);
  std::vector<MatrixXd> grids, gaps;
  std::vector<Index> lengths;
  Index longest = 0;
  for (const MotionRecord& motion : motions) {
    gaps.emplace_back();
    grids.push_back(on_grid(motion, fine, &gaps.back()));
    ends_.push_back(end_of(grids.back()));
    const Index length = audible(grids.back(), lost);
    lengths.push_back(std::max<Index>(2, length));
    longest = std::max(longest, lengths.back());
  }
  Index per_cell = std::max<Index>(1, longest / usual_cells(motions.size()));
  // Cells that are longer than half a period of the fastest motion would show it as a slower one.
  double highest = 0;
  for (std::size_t r = 0; most > 0 && r < grids.size(); ++r) {
    const double samples = kBand / 2 * static_cast<double>(grids[r].cols());
    const auto lines = std::max<Index>(kFewestLines, static_cast<Index>(samples));
    highest = std::max(highest, band_of_motion(grids[r], fine, sample_noise, lines));
  }
  if (kOversampled * highest * fine * static_cast<double>(per_cell) > std::numbers::pi) {
    const double half_period = std::numbers::pi / (kOversampled * highest * fine);
    per_cell = std::max<Index>(1, static_cast<Index>(half_period));
    const Index each = most / static_cast<Index>(motions.size());
    longest = std::min(longest, per_cell * std::max(usual_cells(motions.size()), each));
  }
  for (Index& length : lengths) length = std::min(length, longest);
  step = fine * static_cast<double>(per_cell);
  duration = fine * static_cast<double>(longest);
  factor_ = 1 / std::sqrt(static_cast<double>(per_cell));
  noise = sample_noise * factor_;
  for (std::size_t r = 0; r < grids.size(); ++r) {
    const Index cells = std::max<Index>(2, lengths[r] / per_cell);
    MotionRecord record{VectorXd(cells), MatrixXd(grids[r].rows(), cells)};
    for (Index k = 0; k < cells; ++k) {
      record.time[k] = step * static_cast<double>(k);
      const Index from = std::min(k * per_cell, grids[r].cols() - per_cell);
      record.output.col(k) = grids[r].middleCols(from, per_cell).rowwise().mean();
    }
    bridged_.push_back(record.output);
    // A cell that is mostly a bridge over a gap says nothing.
    for (Index k = 0; k < cells; ++k) {
      const Index from = std::min(k * per_cell, grids[r].cols() - per_cell);
      for (Index c = 0; c < record.output.rows(); ++c) {
        const auto wide =
            (gaps[r].row(c).segment(from, per_cell).array() > kWideGap * fine).count();
        if (2 * wide > per_cell) record.output(c, k) = std::numeric_limits<double>::quiet_NaN();
      }
    }
    records.push_back(std::move(record));
  }
}

std::vector<MatrixXd> DecayCells::weighted() const {
  std::vector<MatrixXd> result;
  for (std::size_t r = 0; r < records.size(); ++r) {
    result.emplace_back(noise.cwiseInverse().asDiagonal() * (bridged_[r].colwise() - ends_[r]));
  }
  return result;
}

Index DecayCells::shortest() const {
  Index least = records.front().time.size();
  for (const MotionRecord& record : records) least = std::min(least, record.time.size());
  return least;
}

}  // namespace dashpot::identification
