#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/safety/brake.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kMargin = 10;         // of gain, that the sampled loop keeps
constexpr double kNearMargin = 3;      // likewise at the edge of an interval
constexpr double kNear = 0.2;          // t / T: short, so that the law keeps its say
constexpr double kFullVelocity = 0.9;  // of a velocity limit: the rest is for what nobody expects
constexpr double kSlowly = 0.5;  // of a velocity limit: what is slower may be pressing on something
constexpr double kBraking = 0.5;       // of the torque that is left: the rest is for other joints
constexpr double kLeastBraking = 0.1;  // of a torque limit, whatever the weight
constexpr double kReturn = 0.025;      // of a velocity limit
constexpr double kFastestStop = 1000;  // velocity limits: no robot, and sums stay finite
constexpr double kMarginShare = 0.02;  // of the way between two position limits
constexpr double kMarginMost = 0.02;   // rad, m

/// The velocity with which a joint may move toward a limit at a distance.
double before(double distance, double braking, double reaction) noexcept {
  if (distance < 0) return distance / reaction;
  const double delayed = braking * reaction;
  // Two forms of the same: the first has no digits where the distance is short.
  return 2 * braking * distance / (std::sqrt(delayed * delayed + 2 * braking * distance) + delayed);
}

}  // namespace

double loop_lag(const Settings& settings) noexcept {
  const Analysis::Sampled& loop = settings.analysis.sampled;
  const double filter = loop.cutoff > 0 ? 1 / (2 * std::numbers::pi * loop.cutoff) : 0;
  return settings.period * (1 + loop.delay + (loop.difference_velocity ? 0.5 : 0)) + filter;
}

Brake::Brake(const Settings& settings) noexcept : n_(settings.limits.torque.size()) {
  const Limits& limits = settings.limits;
  const double lag = loop_lag(settings);
  const double least = kMargin * (lag - 0.5 * settings.period);
  stopping_time_ = std::max(limits.stopping_time, least);
  near_ = std::max(kNear * limits.stopping_time, kNearMargin / kMargin * least);
  for (Eigen::Index i = 0; i < n_; ++i) {
    Bounds& bounds = joints_[static_cast<std::size_t>(i)];
    const double lower = limits.position_lower[i], upper = limits.position_upper[i];
    bounds.outermost = std::min(kMarginMost, kMarginShare * (upper - lower));
    bounds.lower = lower + bounds.outermost;
    bounds.upper = upper - bounds.outermost;
    bounds.velocity = limits.velocity[i];
    bounds.torque = limits.torque[i];
    bounds.torque_rate = limits.torque_rate[i];
    bounds.per_rate = 0.5 / limits.torque_rate[i];
    bounds.reaction = std::max(4 * near_, near_ + lag + limits.torque[i] / limits.torque_rate[i]);
  }
}

JointVector Brake::stop(const Motion& motion, double inward) noexcept {
  JointVector change(n_), torque = JointVector::Zero(n_);
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Bounds& bounds = joint(i);
    const double q = motion.q[i], most = kFastestStop * bounds.velocity;
    double wanted = 0;
    if (q > bounds.upper + bounds.outermost) wanted = -kReturn * inward * bounds.velocity;
    if (q < bounds.lower - bounds.outermost) wanted = kReturn * inward * bounds.velocity;
    change[i] = wanted - std::clamp(motion.qd[i], -most, most);
  }
  add_product(motion.robot.M, change, torque, 1 / stopping_time_);
  JointVector clipped = torque;
  double share = 1;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Bounds& bounds = joint(i);
    const double weight = std::clamp(motion.weight[i], -bounds.torque, bounds.torque);
    clipped[i] = std::clamp(torque[i], -bounds.torque - weight, bounds.torque - weight);
    if (clipped[i] != torque[i]) share = std::min(share, clipped[i] / torque[i]);
  }
  if (share == 1) return torque;
  for (Eigen::Index i = 0; i < n_; ++i) torque[i] *= share;
  if (product(clipped, change) <= product(torque, change)) return torque;
  factor(motion);
  JointVector further = difference(clipped, torque), gained = further;
  accelerate(gained);
  double part = 1;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double way = motion.qd[i] < 0 ? -1 : 1, alike = way * share * change[i] / stopping_time_;
    const double left = (kFullVelocity * joint(i).velocity - way * motion.qd[i]) / near_;
    const double most = std::max(0.0, std::max(left, alike) - alike);
    if (way * gained[i] > most) part = std::min(part, most / (way * gained[i]));
  }
  add(further, torque, part);
  return torque;
}

void Brake::factor(const Motion& motion) noexcept {
  mass_ = motion.mass;
  if (mass_ != nullptr) return;
  own_mass_.compute(motion.robot.M, 1e-14 * motion.robot.M.trace());
  mass_ = &own_mass_;
}

double Brake::distance(const Motion& motion, Eigen::Index i, double way) const noexcept {
  return way > 0 ? joint(i).upper - motion.q[i] : motion.q[i] - joint(i).lower;
}

double Brake::braking_torque(const Motion& motion, Eigen::Index i) const noexcept {
  const double torque = joint(i).torque;
  return kBraking * std::max(torque - std::abs(motion.weight[i]), kLeastBraking * torque);
}

bool Brake::at_ease(const Motion& motion, Eigen::Index i, double acceleration) const noexcept {
  const Bounds& bounds = joint(i);
  const double M = motion.robot.M(i, i), a = std::abs(acceleration);
  const double v = std::abs(motion.qd[i]) + a * std::max(near_, a * M * bounds.per_rate);
  const double left = std::min(bounds.upper - motion.q[i], motion.q[i] - bounds.lower);
  return v <= kFullVelocity * bounds.velocity &&
         v * v * M <= 2 * braking_torque(motion, i) * (left - v * bounds.reaction);
}

Brake::Bound Brake::bound(const Motion& motion, Eigen::Index i, double way) const noexcept {
  const Bounds& bounds = joint(i);
  const double M = motion.robot.M(i, i), full = kFullVelocity * bounds.velocity;
  const double near =
      before(distance(motion, i, way), braking_torque(motion, i) / M, bounds.reaction);
  const double fastest = std::min(full, near), moves = way * motion.qd[i], away = fastest - moves;
  double most = away / near_;
  if (away > 0 && moves > 0) {
    const double slow = std::min(1.0, moves / (kSlowly * fastest));
    most = std::min(most, std::sqrt(2 * away * bounds.torque_rate / M) / slow);
  }
  return {i, way, way * most, near < full};
}

/// Lawson and Hanson's way to a least constraint: one joint more at a time, the one furthest beyond
/// its bound, and out again with those that would have to be driven to theirs.
Status Brake::hold(const Motion& motion, JointVector& excess) noexcept {
  factor(motion);
  JointVector free = difference(excess, motion.robot.coriolis);
  accelerate(free);
  JointVector now = free;
  Status status = Status::kOk;
  count_ = 0;
  for (Eigen::Index pass = 0; pass < 2 * n_; ++pass) {
    Bound worst{-1, 0, 0, false};
    double most = 0;
    for (Eigen::Index i = 0; i < n_; ++i) {
      if (at_ease(motion, i, now[i]) || holds(i)) continue;
      for (const double way : {1.0, -1.0}) {
        const Bound found = bound(motion, i, way);
        const double beyond = way * (now[i] - found.acceleration);
        if (beyond > most) most = beyond, worst = found;
      }
    }
    if (worst.joint < 0) break;
    add_held(worst);
    solve(free);
    now = free;
    for (Eigen::Index k = 0; k < count_; ++k) add(held(k).column, now, held(k).torque);
  }
  for (Eigen::Index k = 0; k < count_; ++k) {
    excess[held(k).bound.joint] += held(k).torque;
    status =
        worse(status, held(k).bound.at_limit ? Status::kNearJointLimit : Status::kTorqueLimited);
  }
  return status;
}

bool Brake::holds(Eigen::Index i) const noexcept {
  for (Eigen::Index k = 0; k < count_; ++k) {
    if (held_[static_cast<std::size_t>(k)].bound.joint == i) return true;
  }
  return false;
}

void Brake::accelerate(JointVector& torque) const noexcept {
  mass_->solve_L(torque.data());
  mass_->solve_LT(torque.data());
}

void Brake::add_held(const Bound& bound) noexcept {
  Held& next = held(count_++);
  next.bound = bound;
  next.torque = 0;
  next.column.setZero(n_);
  next.column[bound.joint] = 1;
  accelerate(next.column);
}

void Brake::solve(const JointVector& free) noexcept {
  while (count_ > 0) {  // each time round with a joint less
    JointMatrix A(count_, count_);
    JointVector torques(count_);
    for (Eigen::Index k = 0; k < count_; ++k) {
      const Bound& bound = held(k).bound;
      for (Eigen::Index l = 0; l < count_; ++l) A(l, k) = held(k).column[held(l).bound.joint];
      torques[k] = bound.acceleration - free[bound.joint];
    }
    constrained_.compute(A, 1e-14 * A.trace());
    constrained_.solve_L(torques.data());
    constrained_.solve_LT(torques.data());
    double share = 1;  // of the way there, before a torque would begin to drive
    Eigen::Index first = -1;
    for (Eigen::Index k = 0; k < count_; ++k) {
      const double from = held(k).torque, to = torques[k];
      if (held(k).bound.way * to < 0) continue;
      const double part = from == to ? 0 : from / (from - to);
      if (first < 0 || part < share) share = part, first = k;
    }
    for (Eigen::Index k = 0; k < count_; ++k) {
      held(k).torque += share * (torques[k] - held(k).torque);
    }
    if (first < 0) return;
    --count_;
    for (Eigen::Index k = first; k < count_; ++k) held(k) = held(k + 1);
  }
}

}  // namespace dashpot::controller
