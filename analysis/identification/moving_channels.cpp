#include <dashpot/analysis/identification/moving_channels.hpp>

#include <cmath>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

using Eigen::Index;

bool moves(const MotionRecord& record, Index channel) {
  double first = std::numeric_limits<double>::quiet_NaN();
  for (const double y : record.output.row(channel)) {
    if (std::isnan(first)) first = y;
    if (std::isfinite(y) && y != first) return true;
  }
  return false;
}

}  // namespace

MovingChannels::MovingChannels(const std::vector<MotionRecord>& all)
    : records(all), count_(all.front().output.rows()) {
  for (Index c = 0; c < count_; ++c) {
    bool any = false;
    for (const MotionRecord& record : all) any = any || moves(record, c);
    if (any) channels.push_back(c);
  }
  if (channels.empty()) throw std::invalid_argument("identify: nothing moves");
  if (static_cast<Index>(channels.size()) == count_) return;
  for (MotionRecord& record : records) {
    record.output = Eigen::MatrixXd(record.output(channels, Eigen::all));
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

}  // namespace dashpot::analysis
