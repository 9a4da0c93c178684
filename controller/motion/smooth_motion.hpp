#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace dashpot::controller {

/// Longest smoothing of a reference, in ticks.
inline constexpr int kMaxSmoothing = 256;

/// Limits of each coordinate by itself. speed(v) is max |v_i| / velocity_i, and effort(a) likewise
/// with the acceleration limits. Both are norms, and 1 at the limit.
struct JointNorm {
  JointVector velocity;      ///< limits, n, rad/s
  JointVector acceleration;  ///< n, rad/s^2

  double speed(const JointVector& v) const noexcept {
    return v.cwiseQuotient(velocity).cwiseAbs().maxCoeff();
  }
  double effort(const JointVector& a) const noexcept {
    return a.cwiseQuotient(acceleration).cwiseAbs().maxCoeff();
  }
};

/// Limits of the linear and the angular part of a twist: speed(V) = max(|v| / v_max, |w| / w_max).
struct TwistNorm {
  double linear_velocity = 1;       ///< limits, m/s
  double angular_velocity = 1;      ///< rad/s
  double linear_acceleration = 1;   ///< m/s^2
  double angular_acceleration = 1;  ///< rad/s^2

  double speed(const Vector6& V) const noexcept {
    return std::max(V.head<3>().norm() / linear_velocity, V.tail<3>().norm() / angular_velocity);
  }
  double effort(const Vector6& A) const noexcept {
    return std::max(A.head<3>().norm() / linear_acceleration,
                    A.tail<3>().norm() / angular_acceleration);
  }
};

/// Replaces the velocity v of a point by the next one, d being goal minus position:
///     v + (c - v) / max(1, effort(c - v) / T),
/// where T is the period. c leads straight to the goal and can brake for it at half the
/// acceleration limit in a whole number k of periods: with b = 1/2 / effort(d), braking as a
/// fraction of d per s^2,
///     c = d min(1 / speed(d), 1/(k T) + (k - 1)/2 b T),  k = ceil((sqrt(1 + 8 / (b T^2)) - 1) /
///     2).
///
/// The result is a weighted mean of v and c, so its speed stays at most 1, and it differs from v by
/// an effort of at most T. Once it equals c, the next c is shorter by b T d: the point brakes and
/// its last period ends at the goal. `share` (0 to 1) scales the speed limit: if it decreases, the
/// point slows down as far as the acceleration limit allows. v catches up with c, because c brakes
/// at half the limit and so changes no faster than v can, from whatever direction the point comes.
/// The goal may move.
///
/// Returns true if a period at the next velocity ends at the goal.
template <class Vector, class Norm>
bool approach(const Vector& d, Vector& v, const Norm& norm, double T, double share = 1) noexcept {
  double rate = 0;  // c = rate d
  bool last = true;
  const double effort = norm.effort(d);
  if (effort > 1e-100) {
    const double bTT = 0.5 * T * T / effort;
    const double k = std::max(1.0, std::ceil(0.5 * (std::sqrt(1 + 8 / bTT) - 1)));
    last = k == 1;
    rate = std::min(share / norm.speed(d), (last ? 1 : 1 / k + 0.5 * (k - 1) * bTT) / T);
  }
  Vector change(d.size());  // c - v
  for (Eigen::Index i = 0; i < d.size(); ++i) change[i] = rate * d[i] - v[i];
  const double size = norm.effort(change);
  for (Eigen::Index i = 0; i < d.size(); ++i) {
    v[i] = size <= T ? rate * d[i] : v[i] + T / size * change[i];
  }
  return size <= T && last;
}

/// Moving average of the last W velocities. It keeps every bound on velocity and acceleration and
/// makes the acceleration continuous, because in a period the acceleration changes by at most 2 / W
/// of its limit. The smoothed position is the position before smoothing plus `offset`. W periods
/// after the end of a motion the offset is exactly zero.
template <class Vector>
class Smoothing {
 public:
  /// `n`: entries of the vectors.
  Smoothing(int window, int n) noexcept
      : window_(std::clamp(window, 1, kMaxSmoothing)),
        sum_(Vector::Zero(n)),
        velocity_(sum_),
        acceleration_(sum_),
        offset_(sum_) {
    reset();
  }

  void reset() noexcept {
    std::fill_n(history_.begin(), window_ * sum_.size(), 0.0);
    sum_.setZero();
    velocity_.setZero();
    acceleration_.setZero();
    offset_.setZero();
    next_ = 0;
    still_ = window_;
  }

  void step(const Vector& velocity, double T) noexcept {
    double* const oldest = history_.data() + next_ * sum_.size();
    next_ = next_ + 1 == window_ ? 0 : next_ + 1;
    bool moves = false;
    const double share = 1.0 / window_;
    for (Eigen::Index i = 0; i < velocity.size(); ++i) {
      moves |= velocity[i] != 0;
      const double change = velocity[i] - oldest[i];
      acceleration_[i] = change * share / T;
      sum_[i] += change;
      oldest[i] = velocity[i];
      velocity_[i] = sum_[i] * share;
      offset_[i] += (velocity_[i] - velocity[i]) * T;
    }
    still_ = moves ? 0 : std::min(still_ + 1, window_);
    if (still_ == window_) {  // removes accumulated rounding errors
      sum_.setZero();
      velocity_.setZero();
      offset_.setZero();
    }
  }

  const Vector& velocity() const noexcept { return velocity_; }
  const Vector& acceleration() const noexcept { return acceleration_; }
  const Vector& offset() const noexcept { return offset_; }

 private:
  int window_;
  int next_ = 0;   ///< oldest entry of the history
  int still_ = 0;  ///< periods without motion, at most the window
  Vector sum_;
  Vector velocity_;
  Vector acceleration_;
  Vector offset_;
  std::array<double, static_cast<std::size_t>(kMaxSmoothing* Vector::MaxSizeAtCompileTime)>
      history_;
};

}  // namespace dashpot::controller
