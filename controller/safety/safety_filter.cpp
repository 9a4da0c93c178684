#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/safety/safety_filter.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {
namespace {

constexpr double kRampTime = 0.1;     // s
constexpr double kLeastRoom = 0.05;   // of a torque limit
constexpr double kSprings = 0.8;      // of the torque beside the weight: the rest is for dampers
constexpr double kReturnRise = 1;     // s
constexpr double kLongestFade = 0.3;  // s: after it a brake is watched even during a fade
constexpr double kFull = 0.9;         // of the tip's speed limit: nothing drives further
constexpr double kWholly = 0.65;      // from here on driving torque is scaled down
constexpr double kMoves = 0.05;       // of a velocity limit: torque that drives ends at once

}  // namespace

SafetyFilter::SafetyFilter(const Settings& settings, double gears) noexcept
    : n_(settings.limits.torque.size()),
      brake_(settings, gears),
      per_tip_velocity_(1 / settings.limits.tip_velocity),
      power_(settings.limits.power),
      ramp_share_(settings.period / kRampTime),
      return_step_(settings.period / kReturnRise),
      longest_fade_(kLongestFade / settings.period),
      last_(JointVector::Zero(n_)),
      asked_(last_) {
  const Limits& limits = settings.limits;
  for (Eigen::Index i = 0; i < n_; ++i) {
    joint(i) = {limits.torque[i], limits.torque_rate[i] * settings.period, 1 / limits.velocity[i]};
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
  stopping_ = 0;
  begin_anew();
}

Status SafetyFilter::apply(const Brake::Motion& motion, double tip_speed, Aim aim,
                           const JointVector& dampers, JointVector& tau) noexcept {
  const bool springs = aim == Aim::kSprings;
  if (springs && !finite(tau) && finite(motion.weight)) {
    begin_anew();
    apply(motion, tip_speed, Aim::kBlind, dampers, tau);
    begin_anew();
    return Status::kNotFinite;
  }
  JointVector excess(n_), brake = JointVector::Zero(n_);
  if (springs) brake_.firm();
  stopping_ = springs ? 0 : stopping_ + 1;
  const bool seen = aim == Aim::kStop || aim == Aim::kReturn;
  const bool alone = seen && (!fades() || stopping_ > longest_fade_);
  if (alone) brake_.watch(motion);
  if (aim == Aim::kFloat) brake_.forget(), brake_.let_go();
  returning_ = aim == Aim::kReturn ? std::min(1.0, returning_ + return_step_) : 0;
  if (springs) {
    asked_ = tau;
    excess = difference(tau, motion.weight);
  } else {
    excess.setZero();
    using Resistance = Brake::Resistance;
    const Resistance resistance = alone  ? Resistance::kGrows
                                  : seen ? Resistance::kWaits
                                         : Resistance::kFades;
    if (aim != Aim::kFloat) brake = brake_.stop(motion, returning_, resistance);
    asked_ = motion.weight;
    add(brake, asked_);
  }
  if (!finite(asked_)) {
    ramp(tau);
    return Status::kNotFinite;
  }
  ramping_ = false;
  Status status = Status::kOk;
  JointVector weight = motion.weight, base = asked_;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double limit = joint(i).torque;
    if (std::abs(weight[i]) > limit) status = Status::kWeightNotHeld;
    weight[i] = std::clamp(weight[i], -limit, limit);
    base[i] = springs ? weight[i] : std::clamp(base[i], -limit, limit);
  }
  if (anew_) take_over(base, weight);
  bool limited = false;
  if (springs) {
    limited = hold_back(motion.qd, tip_speed, excess);
    limited |= share_out(base, dampers, excess);
  }
  if (fading_) limited |= fade(motion.qd, springs, base, excess);
  if (!springs) add(brake, excess);
  if (aim != Aim::kFloat) {
    status = worse(status, brake_.constrain(motion, last_, !springs, excess));
    if (!springs) brake_.limited(motion, excess);
  }
  for (Eigen::Index i = 0; i < n_; ++i) tau[i] = weight[i] + excess[i];
  if (!finite(tau)) {
    ramp(tau);
    return Status::kNotFinite;
  }
  limited |= limit(tau);
  return limited ? worse(status, Status::kTorqueLimited) : status;
}

bool SafetyFilter::hold_back(const JointVector& qd, double tip_speed,
                             JointVector& excess) const noexcept {
  const double power = product(excess, qd);
  if (!(power > 0)) return false;
  double share = std::min(1.0, power_ / power);
  const double v = tip_speed * per_tip_velocity_;
  if (v > kWholly) share *= std::max(0.0, (kFull - v) / (kFull - kWholly));
  if (share == 1) return false;
  for (Eigen::Index i = 0; i < n_; ++i) excess[i] *= share;
  return true;
}

double SafetyFilter::fitting(const JointVector& base, const JointVector& part,
                             double most) const noexcept {
  double share = 1;
  for (Eigen::Index i = 0; i < n_; ++i) {
    // A joint whose weight is about at its limit counts little: `limit` clips its remaining torque.
    const double room = std::max(most * (joint(i).torque - std::copysign(1, part[i]) * base[i]),
                                 kLeastRoom * joint(i).torque);
    if (share * std::abs(part[i]) > room) share = room / std::abs(part[i]);
  }
  return share;
}

bool SafetyFilter::share_out(const JointVector& base, const JointVector& dampers,
                             JointVector& excess) const noexcept {
  bool little = true;  // as almost always
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double most = kSprings * (joint(i).torque - std::abs(base[i]));
    little &= std::abs(excess[i]) + std::abs(dampers[i]) <= most;
  }
  if (little) return false;
  JointVector rest = excess;
  add(dampers, rest, -1);
  const double springs = fitting(base, rest, kSprings);
  if (springs == 1 && fitting(base, excess, 1) == 1) return false;
  const double damping = fitting(base, dampers, 1);
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double limit = joint(i).torque;
    excess[i] =
        std::clamp(springs * rest[i] + damping * dampers[i], -limit - base[i], limit - base[i]);
  }
  return true;
}

void SafetyFilter::ramp(JointVector& tau) noexcept {
  known_ = true;
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
    const double excess = last_[i] - weight[i];
    const double brake = base[i] - weight[i];
    joint(i).acting = excess - std::clamp(brake, std::min(excess, 0.0), std::max(excess, 0.0));
  }
}

bool SafetyFilter::fade(const JointVector& qd, bool springs, const JointVector& base,
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
    const bool drives =
        !springs && bounds.acting * qd[i] > 0 && std::abs(qd[i]) * bounds.per_velocity > kMoves;
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

}  // namespace dashpot::controller
