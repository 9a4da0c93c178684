#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/safety/brake.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kMargin = 10;          // of gain, that the sampled loop keeps
constexpr double kNearMargin = 3;       // likewise at the edge of an interval
constexpr double kNear = 0.2;           // t / T: short, so that the law keeps its say
constexpr double kFullVelocity = 0.85;  // of a velocity limit: the rest is a reserve
constexpr double kSlowly = 0.5;         // of a velocity limit: slower joints may press on something
constexpr double kBraking = 0.5;        // of the remaining torque: the rest is for other joints
constexpr double kLeastBraking = 0.1;   // of a torque limit, whatever the weight
constexpr double kReturn = 0.025;       // of a velocity limit
constexpr double kFastestStop = 1000;   // velocity limits: faster than any robot; sums stay finite
constexpr double kMarginShare = 0.02;   // of the way between two position limits
constexpr double kFell = 0.5;           // of the kinetic energy: the brake has acted,
constexpr double kRose = 0.1;           // and drives the arm back
constexpr double kSlowAlready = 0.1;    // of velocity limits: the brake need not be softer
constexpr double kSoftest = 8;          // times T
constexpr double kMemory = 0.5;         // s, ten times as long as the brake needs
constexpr double kPushed = 0.5;         // of velocity limits: somebody pushes the arm
constexpr double kPushedLeast = 1;      // rad/s, or m/s: the speed of a pushing hand
constexpr double kStiffness = 2.0 / 9;  // times c^2: with it motion decays with c / 3 and 2 c / 3
constexpr double kSmooth = 0.1;         // of T: time constant of velocities
constexpr double kStands = 0.03;        // of a velocity limit
constexpr double kSlows = 2;            // s: slower deceleration means that the arm is driven
constexpr double kFades = 0.5;          // s: of the resistance while the motion is not observed
constexpr double kAllTorque = 0.999;    // of a torque limit
constexpr double kResists = 0.5;        // of a torque limit
constexpr double kRounding = 1e-9;      // N m or rad/s^2, in coordinates in which the mass is 1
constexpr double kSoft = 1e-7;          // of a bound of acceleration, beside one of torque
constexpr double kMarginMost = 0.02;    // rad, m
constexpr double kNearby = 0.02;        // rad (m), or of the inertia: M^-1 is about the same
constexpr double kAbout = 1.5;          // times an acceleration that is known approximately

/// The velocity of a joint toward a limit at a distance.
double before(double distance, double braking, double reaction) noexcept {
  if (distance < 0) return distance / reaction;
  if (std::isinf(distance)) return distance;
  const double delayed = braking * reaction;
  // Two forms of the same value: the first has no significant digits at a short distance.
  return 2 * braking * distance / (std::sqrt(delayed * delayed + 2 * braking * distance) + delayed);
}

}  // namespace

double loop_lag(const Settings& settings) noexcept {
  const Analysis::Sampled& loop = settings.analysis.sampled;
  const double filter = loop.cutoff > 0 ? 1 / (2 * std::numbers::pi * loop.cutoff) : 0;
  return settings.period * (1 + loop.delay + (loop.difference_velocity ? 0.5 : 0)) + filter;
}

Brake::Brake(const Settings& settings, double gears) noexcept : n_(settings.limits.torque.size()) {
  const Limits& limits = settings.limits;
  const double lag = loop_lag(settings);
  const double least = kMargin * (lag - 0.5 * settings.period);
  stopping_time_ = std::max(limits.stopping_time, least);
  period_ = settings.period;
  near_ = std::max({kNear * limits.stopping_time, kNearMargin / kMargin * least, gears});
  lag_ = lag;
  known_.q = JointVector::Constant(n_, std::numeric_limits<double>::infinity());
  for (Eigen::Index i = 0; i < n_; ++i) {
    Bounds& bounds = joints_[static_cast<std::size_t>(i)];
    const double lower = limits.position_lower[i], upper = limits.position_upper[i];
    bounds.outermost = std::min(kMarginMost, kMarginShare * (upper - lower));
    bounds.lower = lower + bounds.outermost;
    bounds.upper = upper - bounds.outermost;
    bounds.velocity = limits.velocity[i];
    bounds.torque = limits.torque[i];
    bounds.torque_rate = limits.torque_rate[i];
    bounds.torque_step = limits.torque_rate[i] * settings.period;
    bounds.per_rate = 0.5 / limits.torque_rate[i];
    bounds.reaction = std::max(4 * near_, near_ + lag + limits.torque[i] / limits.torque_rate[i]);
  }
  firm();
}

double Brake::fastest(const JointVector& momentum) const noexcept {
  double rate = 1 / lag_;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double letting_go = 4 * std::abs(momentum[i]) * joint(i).per_rate;  // s^2
    rate = std::min(rate, 2 / (lag_ + std::sqrt(lag_ * lag_ + letting_go)));
  }
  return rate;
}

JointVector Brake::stop(const Motion& motion, double inward, Resistance resistance) noexcept {
  JointVector wanted = JointVector::Zero(n_), change(n_), momentum = wanted, torque = wanted;
  const double share = seen_ ? std::min(1.0, period_ / (kSmooth * stopping_time())) : 1;
  if (!seen_) v_ = JointVector::Zero(n_);
  for (Eigen::Index i = 0; i < n_; ++i) {
    Bounds& bounds = joint(i);
    const double q = motion.q[i], most = kFastestStop * bounds.velocity;
    if (q > bounds.upper + bounds.outermost) wanted[i] = -kReturn * inward * bounds.velocity;
    if (q < bounds.lower - bounds.outermost) wanted[i] = kReturn * inward * bounds.velocity;
    const double v = std::clamp(motion.qd[i], -most, most);
    v_[i] += share * (v - v_[i]);
    change[i] = wanted[i] - (stands_ ? v_[i] : v);
  }
  add_product(motion.robot.M, change, momentum);
  const double damping = std::min(fastest(momentum), 1 / stopping_time());
  if (resistance == Resistance::kGrows) {
    resist(motion, wanted, kStiffness * damping * damping);
  } else {
    seen_ = false;
  }
  const double left = resistance == Resistance::kFades ? 1 - period_ / kFades : 1;
  for (Eigen::Index i = 0; i < n_; ++i) torque[i] = joint(i).resistance *= left;
  add(momentum, torque, damping);
  return torque;
}

void Brake::resist(const Motion& motion, const JointVector& wanted, double stiffness) noexcept {
  JointVector way = JointVector::Zero(n_), growth = way;
  bool slow = true;
  for (Eigen::Index i = 0; i < n_; ++i) {
    Bounds& bounds = joint(i);
    const double v = std::abs(v_[i] - wanted[i]);
    bounds.slowest = seen_ ? std::min(v, (1 - period_ / kSlows) * bounds.slowest) : v;
    // The joint is slow already, or its cause of motion is stronger than the brake.
    const double least = kStands * bounds.velocity;
    slow &= v <= least || v - bounds.slowest > least;
    const double moved = seen_ ? motion.q[i] - q_[i] : 0;
    const bool yields = bounds.full * moved < 0 && v > kPushed * bounds.velocity;
    const bool returns = wanted[i] * moved > 0;  // only the brake presses
    const double most = resistance_left(motion, i, -moved) / (stiffness * motion.robot.M(i, i));
    if (!returns && !yields) way[i] = std::clamp(moved, -most, most);
  }
  stands_ |= slow;
  add_product(motion.robot.M, way, growth, -stiffness);
  for (Eigen::Index i = 0; i < n_ && stands_; ++i) {
    const double most = resistance_left(motion, i, growth[i]);
    joint(i).resistance += std::clamp(growth[i], -most, most);
  }
  q_ = motion.q;
  seen_ = true;
}

void Brake::limited(const Motion& motion, const JointVector& excess) noexcept {
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double torque = excess[i] + held_weight(motion, i);
    joint(i).full = std::abs(torque) > kAllTorque * joint(i).torque ? torque : 0;
  }
}

double Brake::resistance_left(const Motion& motion, Eigen::Index i, double way) const noexcept {
  const double sign = std::copysign(1, way), torque = joint(i).torque;
  const double most = std::min(kResists * torque, torque - sign * held_weight(motion, i));
  return std::max(0.0, most - sign * joint(i).resistance);
}

void Brake::watch(const Motion& motion) noexcept {
  JointVector momentum = JointVector::Zero(n_);
  JointVector qd = motion.qd;
  for (Eigen::Index i = 0; i < n_ && seen_; ++i) qd[i] = 0.5 * (v_[i] + qd[i]);
  add_product(motion.robot.M, qd, momentum);
  const double energy = 0.5 * product(momentum, qd);
  double slow = 0, pushed = 0, power = 0;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double M = motion.robot.M(i, i), v = joint(i).velocity;
    slow += 0.5 * M * std::pow(kSlowAlready * v, 2);
    pushed += 0.5 * M * std::pow(std::max(kPushed * v, kPushedLeast), 2);
    power += (std::abs(motion.robot.gravity[i]) + std::abs(joint(i).resistance)) * std::abs(qd[i]);
  }
  most_ = std::max(most_, energy);
  if (energy < least_) least_ = energy, given_ = 0;
  given_ = given_ * (1 - period_ / kMemory) + power * period_;
  fell_ |= energy <= kFell * most_;
  const bool driven_back = fell_ && energy > least_ + kRose * most_ + slow;
  if (driven_back && !stands_ && soften()) {  // a holding spring returns the energy of a push
    least_ = energy;
    given_ = 0;
  }
  feeds_ |= energy > least_ + given_ + pushed;
}

bool Brake::soften() noexcept {
  const bool can = 2 * softness_ <= kSoftest * (1 + 1e-9);
  if (!can) return false;
  softness_ *= 2;
  for (Eigen::Index i = 0; i < n_; ++i) joint(i).resistance /= 4;  // like its stiffness
  return true;
}

void Brake::firm() noexcept {
  softness_ = 1;
  feeds_ = false;
  forget();
  let_go();
}

void Brake::let_go() noexcept {
  for (Eigen::Index i = 0; i < n_; ++i) joint(i).resistance = 0;
  stands_ = false;
}

void Brake::forget() noexcept {
  most_ = given_ = 0;
  least_ = std::numeric_limits<double>::infinity();
  fell_ = seen_ = false;
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

double Brake::held_weight(const Motion& motion, Eigen::Index i) const noexcept {
  return std::clamp(motion.weight[i], -joint(i).torque, joint(i).torque);
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

bool Brake::known_nearby(const Motion& motion) const noexcept {
  double moved = std::abs(motion.robot.M.trace() / known_.inertia - 1);
  for (Eigen::Index i = 0; i < n_; ++i)
    moved = std::max(moved, std::abs(motion.q[i] - known_.q[i]));
  return moved <= kNearby;
}

bool Brake::all_at_ease(const Motion& motion, const JointVector& torque) const noexcept {
  double change = 0;
  for (Eigen::Index i = 0; i < n_; ++i) {
    change += known_.response[i] * std::abs(torque[i] - known_.torque[i]);
  }
  bool ease = true;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const double most = std::abs(known_.acceleration[i]) + known_.response[i] * change;
    ease &= at_ease(motion, i, kAbout * most);
  }
  return ease;
}

void Brake::respond(const Motion& motion) noexcept {
  known_.q = motion.q;
  known_.inertia = motion.robot.M.trace();
  known_.response.resize(n_);
  JointVector y(n_);  // a column of L^-1
  for (int i = 0; i < n_; ++i) {
    double sum = 0;
    for (int k = i; k < n_; ++k) {
      double left = k == i ? 1 : 0;
      for (int j = i; j < k; ++j) left -= mass_->L(k, j) * y[j];
      y[k] = left * mass_->per_diagonal(k);
      sum += y[k] * y[k];
    }
    known_.response[i] = std::sqrt(sum);
  }
}

Brake::Bound Brake::acceleration_bound(const Motion& motion, Eigen::Index i, double way,
                                       bool stops) const noexcept {
  const Bounds& bounds = joint(i);
  const double M = motion.robot.M(i, i), full = kFullVelocity * bounds.velocity;
  double near = before(distance(motion, i, way), braking_torque(motion, i) / M, bounds.reaction);
  if (stops) near = std::max(near, 0.0);
  const double fastest = std::min(full, near), moves = way * motion.qd[i], away = fastest - moves;
  double most = away / near_;
  if (stops) {
    most = std::max(most, 0.0);
  } else if (away > 0 && moves > 0) {
    const double slow = std::min(1.0, moves / (kSlowly * fastest));
    most = std::min(most, std::sqrt(2 * away * bounds.torque_rate / M) / slow);
  }
  return {i, Bound::Of::kAcceleration, way, way * most, near < full};
}

Brake::Bound Brake::torque_bound(const Motion& motion, const JointVector& last, Eigen::Index i,
                                 double way) const noexcept {
  const Bounds& bounds = joint(i);
  const double most = std::min(bounds.torque, way * last[i] + bounds.torque_step);
  return {i, Bound::Of::kTorque, way, way * most - held_weight(motion, i), false};
}

bool Brake::clip(const Motion& motion, const JointVector& last,
                 JointVector& excess) const noexcept {
  bool clipped = false;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Bounds& bounds = joint(i);
    const double weight = held_weight(motion, i);
    const double most = std::min(bounds.torque, last[i] + bounds.torque_step) - weight;
    const double least = std::max(-bounds.torque, last[i] - bounds.torque_step) - weight;
    clipped |= excess[i] > most + kRounding || excess[i] < least - kRounding;
    excess[i] = std::max(least, std::min(excess[i], most));
  }
  return clipped;
}

/// Lawson and Hanson's method for the least constraint: adds the bound that is missed by most, and
/// removes bounds whose joints would have to be driven to them.
Status Brake::constrain(const Motion& motion, const JointVector& last, bool stops,
                        JointVector& excess) noexcept {
  Status status = Status::kOk;
  if (!stops && clip(motion, last, excess)) status = Status::kTorqueLimited;
  JointVector free = stops ? excess : difference(excess, motion.robot.coriolis);
  const bool nearby = known_nearby(motion);
  if (!stops && nearby && all_at_ease(motion, free)) return status;
  factor(motion);
  if (!nearby) respond(motion);
  known_.torque = free;
  accelerate(free);
  known_.acceleration = free;
  const JointVector wanted = excess;
  JointVector now = free;
  bool solved = false;
  count_ = 0;
  for (Eigen::Index pass = 0; pass < 8 * n_; ++pass) {
    Bound worst{-1, Bound::Of::kTorque, 0, 0, false};
    double most = kRounding;
    for (Eigen::Index i = 0; i < n_; ++i) {
      const double root = std::sqrt(motion.robot.M(i, i));
      const double toward = excess[i] + held_weight(motion, i) < last[i] ? -1 : 1;
      const Bound torque = torque_bound(motion, last, i, toward);
      const double too_much = toward * (excess[i] - torque.value) / root;
      if (too_much > most && !holds(torque)) most = too_much, worst = torque;
      if (at_ease(motion, i, now[i])) continue;
      for (const double way : {1.0, -1.0}) {
        const Bound found = acceleration_bound(motion, i, way, stops);
        const double beyond = way * (now[i] - found.value) * root;
        if (beyond > most && !holds(found)) most = beyond, worst = found;
      }
    }
    solved = worst.joint < 0;
    if (solved) break;
    hold(motion, worst);
    solve(wanted, free);
    excess = wanted;
    now = free;
    for (Eigen::Index k = 0; k < count_; ++k) {
      const Held& h = held(k);
      const bool torque = h.bound.of == Bound::Of::kTorque;
      add(h.column, torque ? excess : now, h.factor * h.scale);
      (torque ? now : excess)[h.bound.joint] += h.factor * h.scale;
    }
  }
  if (!solved) {  // nearly dependent bounds of many joints: scale all alike, then each
    double share = 1;
    for (Eigen::Index i = 0; i < n_; ++i) {
      const double way = wanted[i] < 0 ? -1 : 1;
      const double most = way * torque_bound(motion, last, i, way).value;
      if (share * std::abs(wanted[i]) > most) share = std::max(most, 0.0) / std::abs(wanted[i]);
    }
    for (Eigen::Index i = 0; i < n_; ++i) excess[i] = share * wanted[i];
    clip(motion, last, excess);
    accelerate(now = excess);
    status = Status::kTorqueLimited;
  }
  if (stops) {
    known_.torque = slowing_ = excess;
    known_.acceleration = now;
    for (Eigen::Index i = 0; i < n_; ++i) slowing_[i] -= joint(i).resistance;
    accelerate(slowing_);
  }
  if (!solved) return status;
  for (Eigen::Index k = 0; k < count_; ++k) {
    status =
        worse(status, held(k).bound.at_limit ? Status::kNearJointLimit : Status::kTorqueLimited);
  }
  return status;
}

bool Brake::holds(const Bound& bound) const noexcept {
  for (Eigen::Index k = 0; k < count_; ++k) {
    const Bound& other = held_[static_cast<std::size_t>(k)].bound;
    if (other.joint == bound.joint && other.of == bound.of) return true;
  }
  return false;
}

void Brake::accelerate(JointVector& torque) const noexcept {
  mass_->solve_L(torque.data());
  mass_->solve_LT(torque.data());
}

void Brake::hold(const Motion& motion, const Bound& bound) noexcept {
  Held next{bound};
  if (bound.of == Bound::Of::kTorque) {
    next.column = motion.robot.M.col(bound.joint);
  } else {
    next.column.setZero(n_);
    next.column[bound.joint] = 1;
    accelerate(next.column);
  }
  next.scale = 1 / std::sqrt(next.column[bound.joint]);
  held(count_++) = next;
}

void Brake::let_go(Eigen::Index k) noexcept {
  --count_;
  for (; k < count_; ++k) held(k) = held(k + 1);
}

bool Brake::factor_held() noexcept {
  BoundMatrix A(count_, count_);
  for (Eigen::Index k = 0; k < count_; ++k) {
    const Held& one = held(k);
    for (Eigen::Index l = 0; l < count_; ++l) {
      const Bound& other = held(l).bound;
      const bool same = one.bound.joint == other.joint;
      const double response = one.bound.of == other.of ? one.column[other.joint] : same ? 1 : 0;
      A(l, k) = one.scale * held(l).scale * response;
    }
    if (one.bound.of == Bound::Of::kAcceleration) A(k, k) += kSoft;
  }
  constrained_.compute(A);
  return constrained_.info() == Eigen::Success;
}

void Brake::solve(const JointVector& torque, const JointVector& acceleration) noexcept {
  while (count_ > 0) {  // with one joint less each time
    if (!factor_held()) return let_go(count_ - 1);
    Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 2 * kMaxJoints, 1> factors(count_);
    for (Eigen::Index k = 0; k < count_; ++k) {
      const Bound& bound = held(k).bound;
      const JointVector& free = bound.of == Bound::Of::kTorque ? torque : acceleration;
      factors[k] = held(k).scale * (bound.value - free[bound.joint]);
    }
    constrained_.solveInPlace(factors);
    double share = 1;  // of the way to the factors, up to where a joint would be driven
    Eigen::Index first = -1;
    for (Eigen::Index k = 0; k < count_; ++k) {
      const double from = held(k).factor, to = factors[k];
      if (held(k).bound.way * to < 0) continue;
      const double part = from == to ? 0 : from / (from - to);
      if (first < 0 || part < share) share = part, first = k;
    }
    for (Eigen::Index k = 0; k < count_; ++k) {
      held(k).factor += share * (factors[k] - held(k).factor);
    }
    if (first < 0) return;
    let_go(first);
  }
}

}  // namespace dashpot::controller
