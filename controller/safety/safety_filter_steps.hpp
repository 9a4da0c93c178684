#pragma once
// SafetyFilter: one torque after the other.

#include <dashpot/controller/safety/safety_filter.hpp>

namespace dashpot::controller {

template <int N>
SafetyFilter<N>::SafetyFilter(const Settings& settings, const Vector& inertia) noexcept
    : torque_(fixed<N>(settings.limits.torque)),
      velocity_(fixed<N>(settings.limits.velocity)),
      lower_(fixed<N>(settings.limits.position_lower)),
      upper_(fixed<N>(settings.limits.position_upper)),
      margin_(fixed<N>(settings.limits.position_margin)),
      return_velocity_(fixed<N>(settings.limits.return_velocity)),
      per_tip_velocity_(1 / settings.limits.tip_velocity),
      power_(settings.limits.power),
      ramp_share_(settings.period / kRampTime),
      return_step_(settings.period / kReturnRise) {
  const double lag = loop_lag(settings);
  for (int i = 0; i < N; ++i) {
    torque_step_[i] = settings.limits.torque_rate[i] * settings.period;
    per_velocity_[i] = 1 / velocity_[i];
    damper_[i] = 0.4 * inertia[i] / lag;
    repulsion_[i] =
        std::min(settings.limits.repulsion * torque_[i], 0.1 * damper_[i] * velocity_[i]);
    toward_[i] = std::min(torque_[i], 0.2 * inertia[i] * margin_[i] / (lag * lag));
    late_[i] = settings.limits.torque_rate[i] * inertia[i];
  }
}

template <int N>
void SafetyFilter<N>::restart() noexcept {
  ramping_ = false;
  returning_ = 0;
  begin_anew();
}

template <int N>
Status SafetyFilter<N>::apply(const Motion& motion, const Vector& weight, Vector& tau) noexcept {
  asked_ = tau;
  if (!finite<N>(tau)) {
    tau = ramp();
    return Status::kNotFinite;
  }
  ramping_ = false;
  Vector excess = difference<N>(tau, weight);
  Vector base;
  Status status = repel(motion, excess, base);
  double fastest = motion.tip_speed * per_tip_velocity_;
  for (int i = 0; i < N; ++i) {
    fastest = std::max(fastest, std::abs(motion.qd[i]) * per_velocity_[i]);
  }
  bool limited = false;
  if (fastest > kFirst) {
    limited = hold_back(motion.qd, fastest, excess);
    limited |= hold_back(motion.qd, fastest, base);
  }
  for (int i = 0; i < N; ++i) {
    if (std::abs(weight[i]) > torque_[i]) status = worse(status, Status::kWeightNotHeld);
    base[i] = std::clamp(base[i] + weight[i], -torque_[i], torque_[i]);
  }
  // Dampers alone oppose each joint's motion: they are clipped one by one, and lose nothing
  // elsewhere.
  if (motion.springs) limited |= shrink(motion.qd, base, excess);
  tau = base;
  add<N>(excess, tau);
  limited |= fade(tau);
  limited |= limit(tau);
  return limited ? worse(status, Status::kTorqueLimited) : status;
}

template <int N>
Status SafetyFilter<N>::repel(const Motion& motion, Vector& excess, Vector& repulsion) noexcept {
  repulsion.setZero();
  bool any_near = false;
  for (int i = 0; i < N; ++i) any_near |= nearer(i, motion.q[i]).distance < margin_[i];
  if (!any_near) {  // as almost always
    returning_ = 0;
    return Status::kOk;
  }
  Status status = Status::kOk;
  bool any_outside = false;
  for (int i = 0; i < N; ++i) {
    const Near near = nearer(i, motion.q[i]);
    if (!(near.distance < margin_[i])) continue;
    const double toward = near.toward, rate = toward * motion.qd[i];
    const double room = std::max(near.distance, 0.0) / margin_[i];
    excess[i] = toward * std::min(toward * excess[i], toward_[i] * room);
    if (near.distance >= 0) {
      const double y = 1 - room;
      const double spring = motion.springs ? repulsion_[i] * y * y : 0;
      repulsion[i] = -toward * (spring + damper_[i] * y * rate);
      status = worse(status, Status::kNearJointLimit);
      continue;
    }
    any_outside = true;
    const double inward = return_velocity_[i] * returning_;
    repulsion[i] =
        -toward * std::clamp(damper_[i] * (inward + rate), -repulsion_[i], repulsion_[i]);
    status = worse(status, Status::kPositionLimit);
  }
  returning_ = motion.returns && any_outside ? std::min(1.0, returning_ + return_step_) : 0;
  return status;
}

template <int N>
bool SafetyFilter<N>::hold_back(const Vector& qd, double fastest, Vector& excess) const noexcept {
  double power = 0;
  for (int i = 0; i < N; ++i) power += excess[i] * qd[i];
  bool changed = false;
  if (power > 0 && fastest > kWholly) {
    const double share = std::max(0.0, (kFull - fastest) / (kFull - kWholly));
    for (int i = 0; i < N; ++i) excess[i] *= share;
    changed = true;
  }
  for (int i = 0; i < N; ++i) {
    const double speed = std::abs(qd[i]), share = speed * per_velocity_[i];
    if (!(excess[i] * qd[i] > 0) || share <= kFirst) continue;
    const double room = std::max(0.0, kFull * velocity_[i] - speed);
    const double most = std::min(std::sqrt(late_[i] * room), damper_[i] * room) +
                        torque_[i] * std::max(0.0, (kWholly - share) / (kWholly - kFirst));
    if (std::abs(excess[i]) <= most) continue;
    excess[i] = std::copysign(most, excess[i]);
    changed = true;
  }
  return changed;
}

template <int N>
bool SafetyFilter<N>::shrink(const Vector& qd, const Vector& base, Vector& excess) const noexcept {
  double power = 0;
  for (int i = 0; i < N; ++i) power += excess[i] * qd[i];
  double share = power > power_ ? power_ / power : 1;
  for (int i = 0; i < N; ++i) {
    // A joint whose weight is about at its limit has little say: `limit` clips what is left of it.
    const double room =
        std::max(torque_[i] - std::copysign(1, excess[i]) * base[i], kLeastRoom * torque_[i]);
    if (share * std::abs(excess[i]) > room) share = room / std::abs(excess[i]);
  }
  if (share == 1) return false;
  for (int i = 0; i < N; ++i) excess[i] *= share;
  return true;
}

template <int N>
Joints<N> SafetyFilter<N>::ramp() noexcept {
  known_ = true;  // what it puts out is what acts
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

/// Adds to the finite `tau` what is left of the torque before `begin_anew`. True if anything is.
template <int N>
bool SafetyFilter<N>::fade(Vector& tau) noexcept {
  if (anew_) {
    double ticks = 1;
    for (int i = 0; i < N; ++i) {
      left_[i] = last_[i] - std::clamp(tau[i], -torque_[i], torque_[i]);
      ticks = std::max(ticks, std::abs(left_[i]) / torque_step_[i]);
    }
    share_step_ = 1 / ticks;
    share_ = 1;
    anew_ = false;
  }
  share_ = share_ > 1.5 * share_step_ ? share_ - share_step_ : 0;
  if (share_ > 0) add<N>(left_, tau, share_);
  return share_ > 0;
}

/// Bounds the finite `tau` and its change, and remembers it. True if that changed it.
template <int N>
bool SafetyFilter<N>::limit(Vector& tau) noexcept {
  bool changed = false;
  for (int i = 0; i < N; ++i) {
    double safe = std::clamp(tau[i], -torque_[i], torque_[i]);
    safe = std::clamp(safe, last_[i] - torque_step_[i], last_[i] + torque_step_[i]);
    changed |= std::abs(safe - tau[i]) > 1e-12 * torque_[i];
    tau[i] = last_[i] = safe;
  }
  return changed;
}

template <int N>
bool SafetyFilter<N>::repels(const Vector& q, bool springs, Vector& stiffness,
                             Vector& damping) const noexcept {
  bool any = false;
  for (int i = 0; i < N; ++i) {
    stiffness[i] = damping[i] = 0;
    const double distance = nearer(i, q[i]).distance;
    if (!(distance < margin_[i])) continue;
    any = true;
    const double y = 1 - std::max(distance, 0.0) / margin_[i];
    stiffness[i] = springs && distance >= 0 ? 2 * repulsion_[i] * y / margin_[i] : 0;
    damping[i] = damper_[i] * y;
  }
  return any;
}

}  // namespace dashpot::controller
