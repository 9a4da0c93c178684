#pragma once
#include <dashpot/controller/joint_algebra.hpp>
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
  using Vector = Joints<N>;

  SafetyFilter(const Limits& limits, double period)
      : torque_(fixed<N>(limits.torque)),
        velocity_(fixed<N>(limits.velocity)),
        lower_(fixed<N>(limits.position_lower)),
        upper_(fixed<N>(limits.position_upper)),
        margin_(limits.position_margin),
        repulsion_(limits.repulsion),
        ramp_share_(period / kRampTime) {
    for (int i = 0; i < N; ++i) torque_step_[i] = limits.torque_rate[i] * period;
  }

  /// Forgets the past; `torque` is what acts now.
  void reset(const Vector& torque) noexcept {
    for (int i = 0; i < N; ++i) last_[i] = std::clamp(torque[i], -torque_[i], torque_[i]);
    ramping_ = false;
  }

  /// Makes a torque safe, in place. kOk, kTorqueLimited, kNearJointLimit, kPositionLimit, or
  /// kNotFinite, and then what `ramp` gives.
  Status apply(const Vector& q, const Vector& qd, Vector& tau) noexcept {
    Status status = repel(q, qd, tau);
    asked_ = tau;
    if (!finite<N>(tau)) {
      tau = ramp();
      return Status::kNotFinite;
    }
    ramping_ = false;
    if (limit(tau)) status = worse(status, Status::kTorqueLimited);
    return status;
  }

  /// Where nothing is known: the last torque goes evenly to zero within 0.1 s.
  Vector ramp() noexcept {
    if (!ramping_) {
      for (int i = 0; i < N; ++i) ramp_step_[i] = ramp_share_ * std::abs(last_[i]);
    }
    ramping_ = true;
    Vector tau;
    for (int i = 0; i < N; ++i) {
      const double left = std::abs(last_[i]) - ramp_step_[i];
      tau[i] = left > 1e-12 * torque_[i] ? std::copysign(left, last_[i]) : 0;
    }
    limit(tau);
    return tau;
  }

  /// What the last `apply` was to put out, and the repulsion, before the limits.
  const Vector& asked() const noexcept { return asked_; }
  /// Whether a position is outside its limits.
  bool outside(const Vector& q) const noexcept {
    for (int i = 0; i < N; ++i) {
      if (q[i] < lower_[i] || q[i] > upper_[i]) return true;
    }
    return false;
  }

 private:
  static constexpr double kRampTime = 0.1;  // s

  /// Adds the repulsion.
  Status repel(const Vector& q, const Vector& qd, Vector& tau) const noexcept {
    Status status = Status::kOk;
    for (int i = 0; i < N; ++i) {
      const double below = q[i] - lower_[i];
      const double above = upper_[i] - q[i];
      if (below < margin_) {
        tau[i] += repulsion(i, below, -qd[i]);
        status = worse(status, below < 0 ? Status::kPositionLimit : Status::kNearJointLimit);
      }
      if (above < margin_) {
        tau[i] -= repulsion(i, above, qd[i]);
        status = worse(status, above < 0 ? Status::kPositionLimit : Status::kNearJointLimit);
      }
    }
    return status;
  }
  double repulsion(int i, double distance, double approach) const noexcept {
    const double x = std::min((margin_ - distance) / margin_, 2.0);
    return repulsion_ * torque_[i] * (x * x + x * std::max(approach, 0.0) / velocity_[i]);
  }

  /// Bounds the finite `tau` and its change, and remembers it. Whether that changed it.
  bool limit(Vector& tau) noexcept {
    bool changed = false;
    for (int i = 0; i < N; ++i) {
      double safe = std::clamp(tau[i], -torque_[i], torque_[i]);
      safe = std::clamp(safe, last_[i] - torque_step_[i], last_[i] + torque_step_[i]);
      changed |= safe != tau[i];
      tau[i] = last_[i] = safe;
    }
    return changed;
  }

  Vector torque_;       ///< limits, N m
  Vector torque_step_;  ///< limits of its change in one tick, N m
  Vector velocity_;     ///< limits, rad/s
  Vector lower_;        ///< limits, rad
  Vector upper_;
  double margin_;
  double repulsion_;
  double ramp_share_;  ///< of the torque, in one tick
  Vector last_ = Vector::Zero();
  Vector asked_ = Vector::Zero();
  bool ramping_ = false;
  Vector ramp_step_ = Vector::Zero();
};

}  // namespace dashpot::controller
