#include <dashpot/identification/search/moving_channels.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dashpot::identification {
namespace {

constexpr double kRounding = 1e-9;  ///< of the largest range
constexpr int kLargestModel = 60;   ///< eigenvalues

bool moves(const MotionRecord& record, Index channel) {
  double first = std::numeric_limits<double>::quiet_NaN();
  for (const double y : record.output.row(channel)) {
    if (std::isnan(first)) first = y;
    if (std::isfinite(y) && y != first) return true;
  }
  return false;
}

/// Which inputs move, by more than rounding errors of those that move most, in any record.
std::vector<Index> moving_inputs(const std::vector<MotionRecord>& records) {
  Eigen::VectorXd range = Eigen::VectorXd::Zero(records.front().input.rows());
  for (const MotionRecord& record : records) {
    for (Index i = 0; i < range.size(); ++i) {
      const auto row = record.input.row(i);
      range[i] = std::max(range[i], row.maxCoeff() - row.minCoeff());
    }
  }
  std::vector<Index> moving;
  for (Index i = 0; i < range.size(); ++i) {
    if (range[i] > kRounding * range.maxCoeff()) moving.push_back(i);
  }
  return moving;
}

}  // namespace

void check_order(const IdentifyOptions& options) {
  check_that(options.max_order >= 0 && options.max_order <= kLargestModel,
             "max_order has to be within 0 and " + std::to_string(kLargestModel));
}

MovingChannels::MovingChannels(const std::vector<MotionRecord>& all)
    : records(all), count_(all.front().output.rows()) {
  for (Index c = 0; c < count_; ++c) {
    bool any = false;
    for (const MotionRecord& record : all) any = any || moves(record, c);
    if (any) channels.push_back(c);
  }
  check_that(!channels.empty(), "nothing moves");
  const std::vector<Index> inputs = moving_inputs(all);
  for (MotionRecord& record : records) {
    record.output = Eigen::MatrixXd(record.output(channels, Eigen::all));
    record.input = Eigen::MatrixXd(record.input(inputs, Eigen::all));
  }
}

Identification MovingChannels::of_all(Identification found) const {
  if (static_cast<Index>(channels.size()) == count_) return found;
  Eigen::VectorXd noise = Eigen::VectorXd::Zero(count_);
  noise(channels) = found.noise;
  found.noise = noise;
  for (auto* list : {&found.modes, &found.rejected}) {
    for (MeasuredMode& mode : *list) {
      Eigen::VectorXcd shape = Eigen::VectorXcd::Zero(count_);
      shape(channels) = mode.shape;
      mode.shape = shape;
    }
  }
  return found;
}

}  // namespace dashpot::identification
