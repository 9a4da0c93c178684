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
///
/// Where springs end or start afresh, what the last torque has beyond the new one fades evenly: in
/// all joints alike, in the least time in which no joint's rate limit has to act on it. Otherwise
/// joints with little torque would let go first, and turn the wrench that the tip exerts.
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
    begin_anew();
  }
  /// The next torque to be applied does not continue the last: the difference fades evenly.
  void begin_anew() noexcept { anew_ = true; }

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
    const bool fades = fade(tau);
    if (limit(tau) || fades) status = worse(status, Status::kTorqueLimited);
    return status;
  }

  /// Where nothing is known: the last torque goes evenly to zero within 0.1 s, or as fast as the
  /// rate limits allow.
  Vector ramp() noexcept {
    if (!ramping_) {
      double share = ramp_share_;
      for (int i = 0; i < N; ++i) {
        if (std::abs(last_[i]) * share > torque_step_[i]) {
          share = torque_step_[i] / std::abs(last_[i]);
        }
      }
      for (int i = 0; i < N; ++i) ramp_step_[i] = share * std::abs(last_[i]);
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

  /// Adds to the finite `tau` what is left of the torque before `begin_anew`. Whether anything is.
  bool fade(Vector& tau) noexcept {
    if (anew_) {
      double ticks = 1;
      for (int i = 0; i < N; ++i) {
        excess_[i] = last_[i] - std::clamp(tau[i], -torque_[i], torque_[i]);
        ticks = std::max(ticks, std::abs(excess_[i]) / torque_step_[i]);
      }
      share_step_ = 1 / ticks;
      share_ = 1;
      anew_ = false;
    }
    share_ = share_ > 1.5 * share_step_ ? share_ - share_step_ : 0;
    if (share_ > 0) add<N>(excess_, tau, share_);
    return share_ > 0;
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
  bool anew_ = true;
  Vector excess_ = Vector::Zero();  ///< of the torque before `begin_anew`, N m
  double share_ = 0;                ///< of it that is left
  double share_step_ = 1;           ///< in one tick
};

}  // namespace dashpot::controller
