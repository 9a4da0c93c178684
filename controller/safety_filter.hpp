#pragma once
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/status.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

/// The last stop of every torque: nothing leaves the controller that does not keep
///     |tau_i| <= torque_i   and   |tau_i - last tau_i| <= torque_rate_i T.
///
/// Before that, joints near a position limit are pushed back. With m the margin, g the distance to
/// the limit (negative beyond it) and x = min((m - g) / m, 2), for x > 0:
///     repulsion torque_i (x^2 + x v / velocity_i),   v >= 0 the velocity toward the limit,
/// away from the limit: zero with zero slope at the margin, Limits::repulsion of the torque limit
/// at the position limit, and a damper that takes energy out on the way in.
template <int N>
class SafetyFilter {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  SafetyFilter(const Limits& limits, double period)
      : limits_(limits),
        largest_(limits.torque),
        largest_step_(limits.torque_rate * period),
        ramp_share_(period / kRampTime),
        velocity_(limits.velocity) {}

  /// Forgets the past; `torque` is what acts now.
  void reset(const Vector& torque) noexcept {
    last_ = torque.cwiseMax(-largest_).cwiseMin(largest_);
    ramping_ = false;
  }

  /// Makes a torque safe, in place. kOk, kTorqueLimited, kNearJointLimit, kPositionLimit, or
  /// kNotFinite, and then what `ramp` gives.
  Status apply(const Vector& q, const Vector& qd, Vector& tau) noexcept {
    Status status = repel(q, qd, tau);
    asked_ = tau;
    if (!tau.allFinite()) {
      tau = ramp();
      return Status::kNotFinite;
    }
    ramping_ = false;
    if (limit(tau)) status = worse(status, Status::kTorqueLimited);
    return status;
  }

  /// Where nothing is known: the last torque goes evenly to zero within 0.1 s.
  Vector ramp() noexcept {
    if (!ramping_) ramp_step_ = ramp_share_ * last_.cwiseAbs();
    ramping_ = true;
    Vector tau = last_.cwiseAbs() - ramp_step_;
    tau = (tau.array() > 1e-12 * largest_.array()).select(tau.cwiseProduct(last_.cwiseSign()), 0);
    limit(tau);
    return tau;
  }

  /// What the last `apply` was to put out, and the repulsion, before the limits.
  const Vector& asked() const noexcept { return asked_; }
  /// Whether a position is outside its limits.
  bool outside(const Vector& q) const noexcept {
    for (int i = 0; i < N; ++i) {
      if (q[i] < limits_.position_lower[i] || q[i] > limits_.position_upper[i]) return true;
    }
    return false;
  }

 private:
  static constexpr double kRampTime = 0.1;  // s

  /// Adds the repulsion.
  Status repel(const Vector& q, const Vector& qd, Vector& tau) const noexcept {
    Status status = Status::kOk;
    for (int i = 0; i < N; ++i) {
      const double below = q[i] - limits_.position_lower[i];
      const double above = limits_.position_upper[i] - q[i];
      if (below < limits_.position_margin) {
        tau[i] += repulsion(i, below, -qd[i]);
        status = worse(status, below < 0 ? Status::kPositionLimit : Status::kNearJointLimit);
      }
      if (above < limits_.position_margin) {
        tau[i] -= repulsion(i, above, qd[i]);
        status = worse(status, above < 0 ? Status::kPositionLimit : Status::kNearJointLimit);
      }
    }
    return status;
  }
  double repulsion(int i, double distance, double approach) const noexcept {
    const double margin = limits_.position_margin;
    const double x = std::min((margin - distance) / margin, 2.0);
    return limits_.repulsion * largest_[i] * (x * x + x * std::max(approach, 0.0) / velocity_[i]);
  }

  /// Bounds the finite `tau` and its change, and remembers it. Whether that changed it.
  bool limit(Vector& tau) noexcept {
    const Vector wanted = tau;
    tau = tau.cwiseMax(-largest_).cwiseMin(largest_);
    tau = tau.cwiseMax(last_ - largest_step_).cwiseMin(last_ + largest_step_);
    last_ = tau;
    return tau != wanted;
  }

  Limits limits_;
  Vector largest_;       ///< N m
  Vector largest_step_;  ///< change of torque in one tick, N m
  double ramp_share_;    ///< of the torque, in one tick
  Vector velocity_;
  Vector last_ = Vector::Zero();
  Vector asked_ = Vector::Zero();
  bool ramping_ = false;
  Vector ramp_step_ = Vector::Zero();
};

}  // namespace dashpot::controller
