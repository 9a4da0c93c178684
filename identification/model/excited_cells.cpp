#include <dashpot/identification/model/excited_cells.hpp>
#include <dashpot/identification/records/common.hpp>
#include <dashpot/identification/records/decay_cells.hpp>
#include <dashpot/identification/records/motion_spectrum.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace dashpot::identification {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr Index kMostCells = 8000;   // of all records
constexpr double kBin = 0.04;        // of the band of the inputs: bins that count together
constexpr double kBridge = 3.5;      // steps, over which samples are interpolated
constexpr double kInBand = 0.99;     // share of the inputs' squares within their band
constexpr double kBeyondInputs = 3;  // times the inputs' band, or a part: motion is within them
constexpr double kLeastCells = 1.5, kWantedCells = 2.2;  // in half a period of the fastest motion
constexpr Index kFewestCells = 20;                       // of a record
// Of a length, so that rounding leaves no point out; of a step, up to which a sample counts as not
// later, or as on time.
constexpr double kOfLength = 1e-9, kSameTime = 1e-6, kOnTime = 1e-3;

/// Frequency below which 99 % of the inputs' squares are, rad/s.
double input_band(const std::vector<DrivenGrid>& grids) {
  double band = 0;
  for (const DrivenGrid& grid : grids) {
    for (const auto& row : grid.input.rowwise()) {
      VectorXd power = difference_power(row.transpose());
      const double width =
          2 * std::numbers::pi / (static_cast<double>(2 * power.size() + 2) * grid.step);
      for (Index k = 0; k < power.size(); ++k) {
        power[k] /= std::pow(2 * std::sin(width * static_cast<double>(k + 1) * grid.step / 2), 2);
      }
      const double all = power.sum();
      double sum = 0;
      Index k = 0;
      while (k < power.size() && sum < kInBand * all) sum += power[k++];
      if (all > 0) band = std::max(band, width * static_cast<double>(k));
    }
  }
  return band;
}

/// The value at `t` of a channel whose samples are around it: a cubic through four of them.
double between(const VectorXd& time, const VectorXd& y, const std::vector<Index>& there,
               std::size_t right, double t) {
  const std::size_t first = std::min(right >= 2 ? right - 2 : 0, there.size() - 4);
  double value = 0;
  for (std::size_t i = first; i < first + 4; ++i) {
    double weight = 1;
    for (std::size_t j = first; j < first + 4; ++j) {
      if (j != i) weight *= (t - time[there[j]]) / (time[there[i]] - time[there[j]]);
    }
    value += weight * y[there[i]];
  }
  return value;
}

/// A record's channels on an even grid, NaN in gaps, and its inputs, which hold their values.
void put_on_grid(const MotionRecord& record, double step, MatrixXd& output, DrivenGrid& driven) {
  const VectorXd& time = record.time;
  const double length = time[time.size() - 1] - time[0];
  const auto N = static_cast<Index>(std::floor(length / step * (1 + kOfLength))) + 1;
  output.setConstant(record.output.rows(), N, kNaN);
  driven.input.resize(record.input.rows(), N);
  driven.step = step;
  Index at = 0;
  for (Index k = 0; k < N; ++k) {
    const double t = time[0] + static_cast<double>(k) * step;
    while (at + 1 < time.size() && time[at + 1] < t + 0.5 * step) ++at;
    driven.input.col(k) = record.input.col(at);
  }
  for (Index c = 0; c < output.rows(); ++c) {
    const VectorXd y = record.output.row(c);
    std::vector<Index> there;
    for (Index i = 0; i < y.size(); ++i) {
      if (std::isfinite(y[i])) there.push_back(i);
    }
    std::size_t right = 0;
    for (Index k = 0; k < N; ++k) {
      const double t = time[0] + static_cast<double>(k) * step;
      while (right + 1 < there.size() && time[there[right]] < t - kSameTime * step) ++right;
      if (std::abs(time[there[right]] - t) < kOnTime * step) {
        output(c, k) = y[there[right]];
      } else if (right > 0 && time[there[right]] - time[there[right - 1]] < kBridge * step) {
        output(c, k) = between(time, y, there, right, t);
      }
    }
  }
}

/// Missing samples replaced by straight lines.
void bridge(MatrixXd& values) {
  for (auto row : values.rowwise()) {
    Index last = -1;
    for (Index k = 0; k < row.size(); ++k) {
      if (!std::isfinite(row[k])) continue;
      for (Index i = last + 1; i < k; ++i) {
        const double share =
            last < 0 ? 1 : static_cast<double>(i - last) / static_cast<double>(k - last);
        row[i] = last < 0 ? row[k] : row[last] + share * (row[k] - row[last]);
      }
      last = k;
    }
    for (Index i = last + 1; i < row.size(); ++i) row[i] = last < 0 ? 0 : row[last];
  }
}

}  // namespace

ExcitedCells::ExcitedCells(const std::vector<MotionRecord>& all) {
  const VectorXd sample_noise = first_noise(all);
  const double fine = typical_step(all);
  std::vector<MatrixXd> grids(all.size());
  auto grids_driven = std::make_shared<std::vector<DrivenGrid>>(all.size());
  Index points = 0;
  for (std::size_t r = 0; r < all.size(); ++r) {
    put_on_grid(all[r], fine, grids[r], (*grids_driven)[r]);
    points += grids[r].cols();
    duration = std::max(duration, fine * static_cast<double>(grids[r].cols()));
  }
  const double band = input_band(*grids_driven);
  if (!(band > 0)) throw std::invalid_argument("identify: no input moves");
  for (MatrixXd whole : grids) {
    bridge(whole);
    const double width = 2 * std::numbers::pi / (static_cast<double>(whole.cols()) * fine);
    highest = std::max(
        highest,
        band_of_motion(whole, fine, sample_noise,
                       std::max<Index>(kFewestLines, static_cast<Index>(kBin * band / width))));
  }
  if (!(highest > 0)) throw std::invalid_argument("identify: nothing follows the inputs");
  highest = std::clamp(highest, band / kBeyondInputs, kBeyondInputs * band);
  const auto most = static_cast<Index>(std::numbers::pi / (kLeastCells * highest * fine));
  const auto wanted = static_cast<Index>(std::numbers::pi / (kWantedCells * highest * fine));
  const Index per_cell = std::max<Index>(1, std::min(most, std::max(wanted, points / kMostCells)));
  step = fine * static_cast<double>(per_cell);
  noise = sample_noise / std::sqrt(static_cast<double>(per_cell));
  for (std::size_t r = 0; r < all.size(); ++r) {
    (*grids_driven)[r].per_cell = per_cell;
    const Index cells = grids[r].cols() / per_cell;
    if (cells < kFewestCells) throw std::invalid_argument("identify: a record is too short");
    MotionRecord record{VectorXd(cells), MatrixXd(grids[r].rows(), cells),
                        MatrixXd((*grids_driven)[r].input.rows(), cells)};
    for (Index k = 0; k < cells; ++k) {
      record.time[k] = step * static_cast<double>(k);
      record.output.col(k) = grids[r].middleCols(k * per_cell, per_cell).rowwise().mean();
      record.input.col(k) =
          (*grids_driven)[r].input.middleCols(k * per_cell, per_cell).rowwise().mean();
    }
    MotionRecord whole = record;
    bridge(whole.output);
    whole.output = noise.cwiseInverse().asDiagonal() * whole.output;
    records.push_back(std::move(record));
    bridged.push_back(std::move(whole));
  }
  driven = std::move(grids_driven);
}

}  // namespace dashpot::identification
