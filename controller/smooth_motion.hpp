#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

namespace dashpot::controller {

/// Longest smoothing of a path, in ticks.
inline constexpr int kMaxSmoothing = 256;

/// Limits of each coordinate by itself: speed(v) = max |v_i| / velocity_i, effort(a) likewise with
/// the acceleration limits. Both are norms, and 1 at the limit.
template <int N>
struct JointNorm {
  using Vector = Eigen::Matrix<double, N, 1>;
  Vector per_velocity;      ///< 1 / velocity limit
  Vector per_acceleration;  ///< 1 / acceleration limit

  double speed(const Vector& v) const noexcept {
    return v.cwiseProduct(per_velocity).cwiseAbs().maxCoeff();
  }
  double effort(const Vector& a) const noexcept {
    return a.cwiseProduct(per_acceleration).cwiseAbs().maxCoeff();
  }
};

/// Limits of a twist's linear and angular part: speed(V) = max(|v| / v_max, |w| / w_max).
struct TwistNorm {
  using Vector = Eigen::Matrix<double, 6, 1>;
  double per_linear_velocity = 1;
  double per_angular_velocity = 1;
  double per_linear_acceleration = 1;
  double per_angular_acceleration = 1;

  double speed(const Vector& V) const noexcept {
    return std::max(V.head<3>().norm() * per_linear_velocity,
                    V.tail<3>().norm() * per_angular_velocity);
  }
  double effort(const Vector& A) const noexcept {
    return std::max(A.head<3>().norm() * per_linear_acceleration,
                    A.tail<3>().norm() * per_angular_acceleration);
  }
};

template <class Vector>
struct Step {
  Vector velocity;
  bool arrives = false;  ///< a period at this velocity ends at the goal
};

/// Next velocity of a point that moves at velocity v, with the way d before it to its goal:
///     v + (c - v) / max(1, effort(c - v) / T),
/// T the period. c leads straight to the goal and can brake for it at half the acceleration limit
/// in a whole number k of periods: with b = 1/2 / effort(d), braking as a fraction of d per s^2,
///     c = d min(1 / speed(d), 1/(k T) + (k - 1)/2 b T),  k = ceil((sqrt(1 + 8 / (b T^2)) - 1) /
///     2).
///
/// The result is a weighted mean of v and c, so its speed stays at most 1, and it differs from v by
/// an effort of at most T. Once it equals c, the next c is shorter by b T d: the point brakes and
/// its last period ends at the goal. It catches up with c, because braking at half the limit c
/// changes no faster than v can, in whatever direction the point comes. The goal may move.
template <class Vector, class Norm>
Step<Vector> approach(const Vector& d, const Vector& v, const Norm& norm, double T) noexcept {
  Vector c = Vector::Zero();
  bool last = true;
  const double effort = norm.effort(d);
  if (effort > 1e-100) {
    const double bTT = 0.5 * T * T / effort;
    const double k = std::max(1.0, std::ceil(0.5 * (std::sqrt(1 + 8 / bTT) - 1)));
    last = k == 1;
    c = d * std::min(1 / norm.speed(d), (last ? 1 : 1 / k + 0.5 * (k - 1) * bTT) / T);
  }
  const double change = norm.effort(c - v);
  if (change <= T) return {c, last};
  return {v + (c - v) * (T / change), false};
}

/// Moving average of the last W velocities. It keeps every bound on velocity and acceleration and
/// makes the acceleration continuous: it changes by at most 2 / W of its limit in a period. The
/// averaged motion is the position that was averaged plus `offset`; W periods after the end of a
/// motion the offset is exactly zero.
template <int D>
class Smoothing {
 public:
  using Vector = Eigen::Matrix<double, D, 1>;

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
    still_ = (velocity.array() == 0).all() ? std::min(still_ + 1, window_) : 0;
    Vector& oldest = history_[static_cast<std::size_t>(next_)];
    acceleration_ = (velocity - oldest) / (window_ * T);
    sum_ += velocity - oldest;
    oldest = velocity;
    next_ = next_ + 1 == window_ ? 0 : next_ + 1;
    if (still_ == window_) {  // sheds what rounding has left over
      sum_.setZero();
      offset_.setZero();
    }
    velocity_ = sum_ / window_;
    offset_ += (velocity_ - velocity) * T;
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
