#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/safety/safety_filter.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kRampTime = 0.1;    // s
constexpr double kLeastRoom = 0.05;  // of a torque limit
constexpr double kReturnRise = 1;    // s
constexpr double kFull = 0.9;        // of a velocity limit: nothing drives further
constexpr double kFirst = 0.5;       // from here on the drive is bounded ...
constexpr double kWholly = 0.65;     // ... and from here on to what can be taken away

}  // namespace

double loop_lag(const Settings& settings) noexcept {
  const Analysis::Sampled& loop = settings.analysis.sampled;
  const double filter = loop.cutoff > 0 ? 1 / (2 * std::numbers::pi * loop.cutoff) : 0;
  return settings.period * (1 + loop.delay + (loop.difference_velocity ? 0.5 : 0)) + filter;
}

SafetyFilter::SafetyFilter(const Settings& settings, const JointVector& inertia) noexcept
    : n_(inertia.size()),
      per_tip_velocity_(1 / settings.limits.tip_velocity),
      power_(settings.limits.power),
      ramp_share_(settings.period / kRampTime),
      return_step_(settings.period / kReturnRise),
      last_(JointVector::Zero(n_)),
      asked_(last_) {
  const Limits& limits = settings.limits;
  const double lag = loop_lag(settings);
  for (Eigen::Index i = 0; i < n_; ++i) {
    Bounds& bounds = joint(i);
    bounds.lower = limits.position_lower[i];
    bounds.upper = limits.position_upper[i];
    bounds.margin = limits.position_margin[i];
    bounds.per_velocity = 1 / limits.velocity[i];
    bounds.torque = limits.torque[i];
    bounds.torque_step = limits.torque_rate[i] * settings.period;
    bounds.velocity = limits.velocity[i];
    bounds.return_velocity = limits.return_velocity[i];
    bounds.damper = 0.4 * inertia[i] / lag;
    bounds.repulsion =
        std::min(limits.repulsion * bounds.torque, 0.1 * bounds.damper * bounds.velocity);
    bounds.toward = std::min(bounds.torque, 0.2 * inertia[i] * bounds.margin / (lag * lag));
    bounds.late = limits.torque_rate[i] * inertia[i];
  }
}

void SafetyFilter::reset(const JointVector& torque) noexcept {
  for (Eigen::Index i = 0; i < n_; ++i) {
    last_[i] = std::clamp(torque[i], -joint(i).torque, joint(i).torque);
  }
  known_ = true;
  restart();
}

void SafetyFilter::restart() noexcept {
  ramping_ = false;
  returning_ = 0;
  begin_anew();
}

Status SafetyFilter::apply(const Motion& motion, const JointVector& weight,
                           JointVector& tau) noexcept {
  asked_ = tau;
  if (!finite(tau)) {
    ramp(tau);
    return Status::kNotFinite;
  }
  ramping_ = false;
  JointVector excess = difference(tau, weight);
  JointVector base(n_);
  Status status = repel(motion, excess, base);
  double fastest = motion.tip_speed * per_tip_velocity_;
  for (Eigen::Index i = 0; i < n_; ++i) {
    fastest = std::max(fastest, std::abs(motion.qd[i]) * joint(i).per_velocity);
  }
  bool limited = false;
  if (fastest > kFirst) {
    limited = hold_back(motion.qd, fastest, excess);
    limited |= hold_back(motion.qd, fastest, base);
  }
  for (Eigen::Index i = 0; i < n_; ++i) {
    if (std::abs(weight[i]) > joint(i).torque) status = worse(status, Status::kWeightNotHeld);
    base[i] = std::clamp(base[i] + weight[i], -joint(i).torque, joint(i).torque);
  }
  if (anew_) take_over(base, weight);
  // Dampers alone oppose each joint's motion: they are clipped one by one, and lose nothing
  // elsewhere.
  if (motion.springs) limited |= shrink(motion.qd, base, excess);
  if (fading_) limited |= fade(motion.qd, base, excess);
  for (Eigen::Index i = 0; i < n_; ++i) tau[i] = base[i] + excess[i];
  limited |= limit(tau);
  return limited ? worse(status, Status::kTorqueLimited) : status;
}

Status SafetyFilter::repel(const Motion& motion, JointVector& excess,
                           JointVector& repulsion) noexcept {
  repulsion.setZero();
  if (!repels(motion.q)) {  // as almost always
    returning_ = 0;
    return Status::kOk;
  }
  Status status = Status::kOk;
  bool any_outside = false;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Bounds::Near near = joint(i).nearer(motion.q[i]);
    if (!(near.distance < joint(i).margin)) continue;
    const double toward = near.toward, rate = toward * motion.qd[i];
    const double room = std::max(near.distance, 0.0) / joint(i).margin;
    excess[i] = toward * std::min(toward * excess[i], joint(i).toward * room);
    if (near.distance >= 0) {
      const double y = 1 - room;
      const double spring = motion.springs ? joint(i).repulsion * y * y : 0;
      repulsion[i] = -toward * (spring + joint(i).damper * y * rate);
      status = worse(status, Status::kNearJointLimit);
      continue;
    }
    any_outside = true;
    const double inward = joint(i).return_velocity * returning_;
    repulsion[i] = -toward * std::clamp(joint(i).damper * (inward + rate), -joint(i).repulsion,
                                        joint(i).repulsion);
    status = worse(status, Status::kPositionLimit);
  }
  returning_ = motion.returns && any_outside ? std::min(1.0, returning_ + return_step_) : 0;
  return status;
}

bool SafetyFilter::hold_back(const JointVector& qd, double fastest,
                             JointVector& excess) const noexcept {
  double power = 0;
  for (Eigen::Index i = 0; i < n_; ++i) power += excess[i] * qd[i];
  bool changed = false;
  if (power > 0 && fastest > kWholly) {
    const double share = std::max(0.0, (kFull - fastest) / (kFull - kWholly));
    for (Eigen::Index i = 0; i < n_; ++i) excess[i] *= share;
    changed = true;
  }
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double speed = std::abs(qd[i]), share = speed * joint(i).per_velocity;
    if (!(excess[i] * qd[i] > 0) || share <= kFirst) continue;
    const double room = std::max(0.0, kFull * joint(i).velocity - speed);
    const double most = std::min(std::sqrt(joint(i).late * room), joint(i).damper * room) +
                        joint(i).torque * std::max(0.0, (kWholly - share) / (kWholly - kFirst));
    if (std::abs(excess[i]) <= most) continue;
    excess[i] = std::copysign(most, excess[i]);
    changed = true;
  }
  return changed;
}

bool SafetyFilter::shrink(const JointVector& qd, const JointVector& base,
                          JointVector& excess) const noexcept {
  double power = 0;
  for (Eigen::Index i = 0; i < n_; ++i) power += excess[i] * qd[i];
  double share = power > power_ ? power_ / power : 1;
  for (Eigen::Index i = 0; i < n_; ++i) {
    // A joint whose weight is about at its limit has little say: `limit` clips what is left of it.
    const double room = std::max(joint(i).torque - std::copysign(1, excess[i]) * base[i],
                                 kLeastRoom * joint(i).torque);
    if (share * std::abs(excess[i]) > room) share = room / std::abs(excess[i]);
  }
  if (share == 1) return false;
  for (Eigen::Index i = 0; i < n_; ++i) excess[i] *= share;
  return true;
}

void SafetyFilter::ramp(JointVector& tau) noexcept {
  known_ = true;  // what it puts out is what acts
  if (!ramping_) {
    double share = ramp_share_;
    for (Eigen::Index i = 0; i < n_; ++i) {
      if (std::abs(last_[i]) * share > joint(i).torque_step) {
        share = joint(i).torque_step / std::abs(last_[i]);
      }
    }
    for (Eigen::Index i = 0; i < n_; ++i) joint(i).ramp_step = share * std::abs(last_[i]);
  }
  ramping_ = true;
  tau.resize(n_);
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double left = std::abs(last_[i]) - joint(i).ramp_step;
    tau[i] = left > 1e-12 * joint(i).torque ? std::copysign(left, last_[i]) : 0;
  }
  limit(tau);
}

void SafetyFilter::take_over(const JointVector& base, const JointVector& weight) noexcept {
  anew_ = false;
  fading_ = true;
  fade_ticks_ = 0;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double excess = last_[i] - std::clamp(weight[i], -joint(i).torque, joint(i).torque);
    const double repulsion = base[i] - weight[i];
    joint(i).acting = excess - std::clamp(repulsion, std::min(excess, 0.0), std::max(excess, 0.0));
  }
}

bool SafetyFilter::fade(const JointVector& qd, const JointVector& base,
                        JointVector& excess) noexcept {
  double ticks = 1;
  const auto way = [&](Eigen::Index i) {
    const Bounds& bounds = joint(i);
    return std::clamp(excess[i], -bounds.torque - base[i], bounds.torque - base[i]) - bounds.acting;
  };
  for (Eigen::Index i = 0; i < n_; ++i) {
    ticks = std::max(ticks, std::abs(way(i)) / joint(i).torque_step);
  }
  if (fade_ticks_ == 0) fade_ticks_ = ticks;
  fading_ = ticks > 1 && fade_ticks_ > 1.5;
  if (!fading_) return false;
  fade_ticks_ -= 1;
  for (Eigen::Index i = 0; i < n_; ++i) {
    Bounds& bounds = joint(i);
    const bool drives = bounds.acting * qd[i] > 0 && std::abs(qd[i]) * bounds.per_velocity >= 1;
    excess[i] = bounds.acting +=
        drives ? std::clamp(way(i), -bounds.torque_step, bounds.torque_step) : way(i) / ticks;
  }
  return true;
}

bool SafetyFilter::limit(JointVector& tau) noexcept {
  bool changed = false;
  for (Eigen::Index i = 0; i < n_; ++i) {
    double safe = std::clamp(tau[i], -joint(i).torque, joint(i).torque);
    safe = std::clamp(safe, last_[i] - joint(i).torque_step, last_[i] + joint(i).torque_step);
    changed |= std::abs(safe - tau[i]) > 1e-12 * joint(i).torque;
    tau[i] = last_[i] = safe;
  }
  return changed;
}

bool SafetyFilter::repels(const JointVector& q) const noexcept {
  bool any = false;
  for (Eigen::Index i = 0; i < n_; ++i) any |= joint(i).nearer(q[i]).distance < joint(i).margin;
  return any;
}

void SafetyFilter::add_repulsion(const JointVector& q, bool springs, JointMatrix& stiffness,
                                 JointMatrix& damping) const noexcept {
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Bounds& bounds = joint(i);
    const double distance = bounds.nearer(q[i]).distance;
    if (!(distance < bounds.margin)) continue;
    const double y = 1 - std::max(distance, 0.0) / bounds.margin;
    if (springs && distance >= 0) stiffness(i, i) += 2 * bounds.repulsion * y / bounds.margin;
    damping(i, i) += bounds.damper * y;
  }
}

JointVector SafetyFilter::borne(JointVector damping) const noexcept {
  for (Eigen::Index i = 0; i < n_; ++i) {
    damping[i] = std::min(damping[i], 2.5 * joint(i).damper);
  }
  return damping;
}

}  // namespace dashpot::controller
