#pragma once
#include <dashpot/controller/base/joint_algebra.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace dashpot::controller {

/// Longest smoothing of a reference, in ticks.
inline constexpr int kMaxSmoothing = 256;

/// Limits of each coordinate by itself. speed(v) is max |v_i| / velocity_i, and effort(a) likewise
/// with the acceleration limits. Both are norms, and 1 at the limit.
template <int N>
struct JointNorm {
  Joints<N> velocity;      ///< limits, rad/s
  Joints<N> acceleration;  ///< rad/s^2

  double speed(const Joints<N>& v) const noexcept { return largest(v, velocity); }
  double effort(const Joints<N>& a) const noexcept { return largest(a, acceleration); }

 private:
  static double largest(const Joints<N>& x, const Joints<N>& limit) noexcept {
    double result = 0;
    for (int i = 0; i < N; ++i) result = std::max(result, std::abs(x[i]) / limit[i]);
    return result;
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

template <int D>
struct Step {
  Joints<D> velocity;
  bool arrives = false;  ///< a period at this velocity ends at the goal
};

/// Returns the next velocity of a point that moves at velocity v, d being goal minus position:
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
template <int D, class Norm>
Step<D> approach(const Joints<D>& d, const Joints<D>& v, const Norm& norm, double T,
                 double share = 1) noexcept {
  double rate = 0;  // c = rate d
  bool last = true;
  const double effort = norm.effort(d);
  if (effort > 1e-100) {
    const double bTT = 0.5 * T * T / effort;
    const double k = std::max(1.0, std::ceil(0.5 * (std::sqrt(1 + 8 / bTT) - 1)));
    last = k == 1;
    rate = std::min(share / norm.speed(d), (last ? 1 : 1 / k + 0.5 * (k - 1) * bTT) / T);
  }
  Joints<D> change;  // c - v
  for (int i = 0; i < D; ++i) change[i] = rate * d[i] - v[i];
  const double size = norm.effort(change);
  Step<D> step;
  step.arrives = size <= T && last;
  const double part = size <= T ? 1 : T / size;
  for (int i = 0; i < D; ++i) {
    step.velocity[i] = size <= T ? rate * d[i] : v[i] + part * change[i];
  }
  return step;
}

/// Moving average of the last W velocities. It keeps every bound on velocity and acceleration and
/// makes the acceleration continuous, because in a period the acceleration changes by at most 2 / W
/// of its limit. The smoothed position is the position before smoothing plus `offset`. W periods
/// after the end of a motion the offset is exactly zero.
template <int D>
class Smoothing {
 public:
  using Vector = Joints<D>;

  explicit Smoothing(int window) noexcept : window_(std::clamp(window, 1, kMaxSmoothing)) {
    reset();
  }

  void reset() noexcept {
    std::fill_n(history_.begin(), window_, Vector::Zero());
    sum_.setZero();
    velocity_.setZero();
    acceleration_.setZero();
    offset_.setZero();
    next_ = 0;
    still_ = window_;
  }

  void step(const Vector& velocity, double T) noexcept {
    Vector& oldest = history_[static_cast<std::size_t>(next_)];
    next_ = next_ + 1 == window_ ? 0 : next_ + 1;
    bool moves = false;
    for (int i = 0; i < D; ++i) moves |= velocity[i] != 0;
    still_ = moves ? 0 : std::min(still_ + 1, window_);
    const double share = 1.0 / window_;
    for (int i = 0; i < D; ++i) {
      const double change = velocity[i] - oldest[i];
      acceleration_[i] = change * share / T;
      sum_[i] += change;
      oldest[i] = velocity[i];
      velocity_[i] = sum_[i] * share;
      offset_[i] += (velocity_[i] - velocity[i]) * T;
    }
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
  std::array<Vector, kMaxSmoothing> history_;
};

}  // namespace dashpot::controller
