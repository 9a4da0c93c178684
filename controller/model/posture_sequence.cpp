#include <dashpot/controller/posture.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

/// The number after `state` of the generator SplitMix64 (Steele, Lea and Flood 2014), in [0, 1).
double next_share(std::uint64_t& state) {
  std::uint64_t z = state += 0x9e3779b97f4a7c15;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return std::ldexp(static_cast<double>((z ^ (z >> 31)) >> 11), -53);
}

}  // namespace

PostureSequence::PostureSequence(const JointVector& lower, const JointVector& upper,
                                 std::uint64_t seed)
    : lower_(lower.cwiseMax(-std::numbers::pi)),
      upper_(upper.cwiseMin(std::numbers::pi)),
      step_(lower.size()),
      offset_(JointVector::Zero(lower.size())) {
  double phi = 1.5;
  const double root = 1.0 / static_cast<double>(lower.size() + 1);
  for (int k = 0; k < 60; ++k) phi = std::pow(phi + 1, root);  // contracts by at least 1/3
  for (Eigen::Index i = 0; i < step_.size(); ++i) {
    step_[i] = std::pow(phi, -static_cast<double>(i + 1));
    if (seed != 0) offset_[i] = next_share(seed);
    if (lower_[i] <= upper_[i]) continue;
    if (lower[i] > 0) {  // both limits are beyond half a turn; the upper one may be infinite
      upper_[i] = std::min(upper[i], lower[i] + 2 * std::numbers::pi);
    } else {
      lower_[i] = std::max(lower[i], upper[i] - 2 * std::numbers::pi);
    }
  }
}

JointVector PostureSequence::at(std::int64_t index) const {
  JointVector q(step_.size());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const double share = offset_[i] + static_cast<double>(index + 1) * step_[i];
    q[i] = lower_[i] + (share - std::floor(share)) * (upper_[i] - lower_[i]);
  }
  return q;
}

}  // namespace dashpot::controller
