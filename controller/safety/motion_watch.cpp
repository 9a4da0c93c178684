#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/safety/motion_watch.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {
namespace {

// For frozen(): friction reverses with the motion, so that torque may change by twice as much.
constexpr double kStiction = 0.05;     // of the torque limit, beside
constexpr double kPerCoulomb = 3;      // times the friction of the model: stiction is larger
constexpr double kAnyStiction = 0.15;  // of the torque limit, if the model has no friction
constexpr double kCounts = 1.5;        // of an encoder: the largest motion that it does not show
// For gains():
constexpr double kUndone = 0.4;        // of the torque's power: wrong masses and rotors
constexpr double kUnweighed = 0.3;     // of the weight
constexpr double kHand = 35;           // N, at the tip: a push, or an unknown payload of 3 kg
constexpr double kFast = 0.5;          // of velocity limits: a pushed arm is slower
constexpr double kFastLeast = 1;       // rad/s, or m/s: the speed of a pushing hand
constexpr double kForgotten = 0.05;    // s
constexpr double kLongestBlow = 0.03;  // s: a blow ends sooner, a weak motor does not

}  // namespace

MotionWatch::MotionWatch(const RobotModel& model, const Settings& settings) noexcept
    : n_(model.dof()),
      gravity_(settings.feed_forward.gravity),
      external_force_(settings.limits.external_force),
      tip_limit_(settings.limits.tip_velocity),
      frozen_after_(0.4 * settings.watchdog.feedback),
      wall_count_(std::min(settings.limits.walls.size(), kMaxWalls)) {
  const Limits& limits = settings.limits;
  const JointVector coulomb = model.joint_values(&Joint::coulomb_friction);
  for (Eigen::Index i = 0; i < n_; ++i) {
    joint(i) = {limits.position_lower[i],
                limits.position_upper[i],
                limits.velocity[i],
                limits.torque[i],
                coulomb[i] > 0 ? kStiction * limits.torque[i] + kPerCoulomb * coulomb[i]
                               : kAnyStiction * limits.torque[i],
                limits.external_torque[i]};
    estimates_ |= std::isfinite(limits.external_torque[i]);
  }
  std::copy_n(limits.walls.begin(), wall_count_, walls_.begin());
}

void MotionWatch::reset() noexcept {
  first_ = true;
  frozen_ = false;
  torques_ = 0;
  tip_speed_ = same_ = strained_ = gained_ = gaining_ = 0;
  energy_ = -1;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Record& r = joint(i);
    joint(i) = {r.lower, r.upper, r.velocity_limit, r.torque_limit, r.stiction, r.external_limit};
  }
}

Status MotionWatch::check(const Tick& tick) noexcept {
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  bool fast = false, outside = false, unstable = false;
  constexpr double kSlow = 0.05;  // s
  const double share = std::min(1.0, tick.dt / kSlow);
  for (Eigen::Index i = 0; i < n_; ++i) {
    Record& joint = this->joint(i);
    v += tick.qd[i] * tick.robot.J.col(i).head<3>();
    fast |= std::abs(tick.qd[i]) > joint.velocity_limit;
    outside |= tick.q[i] < joint.lower || tick.q[i] > joint.upper;
    unstable |= joint.grows(tick.qd[i], tick.still);
    unstable |= joint.vibrates(tick.qd[i], tick.dt, share);
    unstable |= joint.reversals > 0.47;
  }
  const double largest = v.cwiseAbs().maxCoeff();  // whose square may overflow
  tip_speed_ = largest > 0 ? largest * (v / largest).norm() : 0;
  Status status = Status::kOk;
  if (collides(tick)) status = Status::kCollision;
  if (unstable) status = Status::kInstability;
  if (tip_speed_ > tip_limit_) status = Status::kTipSpeedLimit;
  if (fast) status = Status::kVelocityLimit;
  for (std::size_t k = 0; k < wall_count_; ++k) {
    if (walls_[k].distance(tick.robot.p_BT_B) < 0) status = Status::kWall;
  }
  if (outside) status = Status::kPositionLimit;
  const bool gained = gains(tick);
  if (frozen(tick)) {
    status = Status::kStateFrozen;
    energy_ = -1;  // unknown from this velocity
  } else if (gained) {
    status = Status::kBrakeDoubted;
  }
  first_ = false;
  torques_ = 0;
  for (Eigen::Index i = 0; i < n_; ++i) {
    Record& joint = this->joint(i);
    const double moved = std::abs(tick.q[i] - joint.q);
    if (moved > 0) joint.count = std::min(joint.count, moved);
    joint.q = tick.q[i];
    joint.qd = tick.qd[i];
  }
  return status;
}

void MotionWatch::applied(const JointVector& torque, const JointVector& weight) noexcept {
  ++torques_;
  for (Eigen::Index i = 0; i < n_; ++i) {
    Record& joint = this->joint(i);
    const double excess = torque[i] - weight[i];
    const bool reversed =
        excess * joint.excess < 0 &&
        std::min(std::abs(excess), std::abs(joint.excess)) > 0.05 * joint.torque_limit;
    joint.reversals += ((reversed ? 1 : 0) - joint.reversals) / 64;
    joint.excess = excess;
    joint.torque = torques_ == 1 ? torque[i] : joint.torque + (torque[i] - joint.torque) / torques_;
    joint.beside = torques_ == 1 ? excess : joint.beside + (excess - joint.beside) / torques_;
  }
}

bool MotionWatch::collides(const Tick& tick) noexcept {
  if (tick.external_wrench.head<3>().norm() > external_force_) return true;
  if (!estimates_ || first_) return false;
  constexpr double kTimeConstant = 0.01;                  // s
  JointVector change(n_), force = JointVector::Zero(n_);  // M qdd
  for (Eigen::Index i = 0; i < n_; ++i) change[i] = tick.qd[i] - joint(i).qd;
  add_product(tick.robot.M, change, force, 1 / tick.dt);
  bool found = false;
  const double share = std::min(1.0, tick.dt / kTimeConstant);
  for (Eigen::Index i = 0; i < n_; ++i) {
    Record& joint = this->joint(i);
    const double weight = gravity_ ? tick.robot.gravity[i] : 0;  // or held by the robot
    const double now = force[i] + tick.robot.coriolis[i] + weight - joint.torque;
    joint.external += share * (now - joint.external);
    found |= !(std::abs(joint.external) <= joint.external_limit);  // also if it is NaN
  }
  return found;
}

bool MotionWatch::Record::grows(double now, bool still) noexcept {
  constexpr int kHalfSwings = 10;
  constexpr double kGrowth = 1.02, kLarge = 0.1;  // of the velocity limit
  if (now * qd < 0) {
    const bool larger = peak > kGrowth * last_peak && peak > 1e-6;
    grown = larger && still ? grown + 1 : 0;
    last_peak = peak;
    peak = 0;
  }
  peak = std::max(peak, std::abs(now));
  return grown >= kHalfSwings && peak > kLarge * velocity_limit;
}

bool MotionWatch::Record::vibrates(double now, double dt, double share) noexcept {
  constexpr double kHigh = 0.18;     // of the velocity limit: of a fifth, `slow` takes a part
  constexpr double kLongest = 0.09;  // s, of a half swing: 5.6 Hz
  constexpr double kEnough = 0.4;    // s; the vibration after a blow decays sooner
  constexpr int kSwings = 10;
  slow += share * (now - slow);
  const double last = fast;
  fast = now - slow;
  if (fast * last < 0 || swing > kLongest) {
    const bool counts = swing <= kLongest && height > kHigh * velocity_limit;
    vibrating = std::max(0.0, vibrating + (counts ? swing : -0.5 * swing));
    swings = vibrating > 0 ? swings + (counts ? 1 : 0) : 0;
    swing = height = 0;
  }
  swing += dt;
  height = std::max(height, std::abs(fast));
  return swings >= kSwings && vibrating >= kEnough;
}

void MotionWatch::forget_swings() noexcept {
  for (Eigen::Index i = 0; i < n_; ++i) {
    joint(i).grown = joint(i).swings = 0;
    joint(i).vibrating = joint(i).reversals = 0;
  }
}

bool MotionWatch::frozen(const Tick& tick) noexcept {
  bool same = !first_ && frozen_after_ > 0;
  for (Eigen::Index i = 0; i < n_ && same; ++i) {
    same = tick.q[i] == joint(i).q && tick.qd[i] == joint(i).qd;
  }
  if (!same) {
    same_ = strained_ = 0;
    frozen_ = false;
    for (Eigen::Index i = 0; i < n_; ++i) joint(i).before = joint(i).excess;
    return false;
  }
  same_ += tick.dt;
  constexpr double kCreeps = 0.04;  // s
  constexpr double kWay = 1e-4;     // rad (m)
  for (Eigen::Index i = 0; i < n_ && same_ >= kCreeps; ++i) {
    frozen_ |= std::abs(tick.qd[i]) * same_ > std::max(kWay, kCounts * joint(i).count);
  }
  bool strained = false;
  for (Eigen::Index i = 0; i < n_ && !strained; ++i) {
    strained = std::abs(joint(i).excess - joint(i).before) > joint(i).stiction;
  }
  strained_ = strained ? strained_ + tick.dt : 0;
  frozen_ |= strained_ >= frozen_after_;
  return frozen_;  // until the state changes, also if the torque returns
}

bool MotionWatch::gains(const Tick& tick) noexcept {
  const double last = energy_;
  energy_ = -1;
  if (!tick.brakes || first_) gained_ = 0;
  if (!tick.brakes) return false;
  JointVector momentum = JointVector::Zero(n_);
  add_product(tick.robot.M, tick.qd, momentum);
  energy_ = 0.5 * product(momentum, tick.qd);
  if (last < 0) return false;
  double given = 0, unsure = kHand * tip_speed_, fast = 0;  // W, W, J
  for (Eigen::Index i = 0; i < n_; ++i) {
    const Record& joint = this->joint(i);
    const double v = 0.5 * (tick.qd[i] + joint.qd), power = joint.beside * v;
    given += power;
    unsure += kUndone * std::abs(power) + kUnweighed * std::abs(tick.robot.gravity[i] * v);
    const double most = std::max(kFast * joint.velocity_limit, kFastLeast);
    fast += 0.5 * tick.robot.M(i, i) * most * most;
  }
  const double more = energy_ - last - (given + unsure) * tick.dt;
  gained_ = std::max(0.0, gained_ + more);
  if (energy_ < fast) gained_ -= std::min(1.0, tick.dt / kForgotten) * gained_;
  const double longer = more > 0 ? tick.dt : -tick.dt;
  gaining_ = gained_ > fast ? std::max(0.0, gaining_ + longer) : 0;
  return gaining_ > kLongestBlow;
}

}  // namespace dashpot::controller
