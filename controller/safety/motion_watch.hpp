#pragma once
#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/status.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace dashpot::controller {

/// Notices what an arm must not go on with: see the statuses that latch. Each tick is given to
/// `check`, if its state is good, and the torque that comes of it to `applied` in any case.
///
/// - kCollision: the external torque r, estimated with a time constant of 10 ms from
///       r <- r + T / 10 ms (M (qd - last qd) / T + coriolis + gravity - tau - r),
///   tau being the mean of what was applied meanwhile, or the force at the tip that the robot
///   reports, is above its threshold. Without a threshold for a joint nothing is computed.
/// - kInstability: a joint swings to and fro with a velocity that grows by 2 % or more with each of
///   ten half swings, to more than a tenth of its limit, while the springs stand still; or the
///   torque beyond the weight reverses, at more than a twentieth of its limit, in every tick for 40
///   ticks, or in every other tick for 180.
/// - kStateFrozen: position and velocity stay the same to the last bit for 0.4 times
///   Watchdog::feedback, while that torque changes by a twentieth of its limit more than Coulomb
///   friction explains.
template <int N>
class MotionWatch {
 public:
  using Vector = Joints<N>;

  MotionWatch(const RobotModel& model, const Settings& settings) noexcept;
  void reset() noexcept;

  struct Tick {
    double dt;  ///< since the last one, s
    const Vector& q;
    const Vector& qd;
    const Dynamics<N>& robot;
    const Vector6& external_wrench;
    bool still;  ///< the springs stand still
  };
  /// Returns kOk, or the worst of the statuses kCollision to kStateFrozen that holds now.
  Status check(const Tick& tick) noexcept;
  /// `excess`: of the torque over the weight.
  void applied(const Vector& torque, const Vector& excess) noexcept;

  /// True as long as the state is frozen, so that its velocity means nothing.
  bool sees_frozen() const noexcept { return frozen_; }
  /// Returns the tip's speed at the last tick, m/s.
  double tip_speed() const noexcept { return tip_speed_; }

 private:
  bool collides(const Tick& tick) noexcept;
  bool grows(const Tick& tick) noexcept;
  bool reverses() const noexcept;
  bool frozen(const Tick& tick) noexcept;

  Vector torque_limit_;
  Vector velocity_limit_;
  Vector lower_, upper_;
  Vector coulomb_;
  Vector external_limit_;
  bool estimates_ = false;
  bool gravity_;  ///< is compensated here
  double external_force_;
  double tip_limit_;
  double frozen_after_;
  std::array<Wall, kMaxWalls> walls_;
  std::size_t wall_count_;

  bool first_ = true;
  double tip_speed_ = 0;
  Vector q_, qd_;    ///< of the last tick
  Vector torque_;    ///< applied since, the mean
  int torques_ = 0;  ///< how many
  Vector external_;  ///< r
  Vector excess_;    ///< applied since
  Vector before_;    ///< excess when the state was last seen to change
  double same_ = 0;  ///< for how long it has not, s
  bool frozen_ = false;
  Vector peak_, last_peak_;     ///< of |qd| in this half swing and the last
  std::array<int, N> grown_{};  ///< half swings, one larger than the other
  Vector reversals_;            ///< share of the last ticks
};

template <int N>
MotionWatch<N>::MotionWatch(const RobotModel& model, const Settings& settings) noexcept
    : torque_limit_(fixed<N>(settings.limits.torque)),
      velocity_limit_(fixed<N>(settings.limits.velocity)),
      lower_(fixed<N>(settings.limits.position_lower)),
      upper_(fixed<N>(settings.limits.position_upper)),
      coulomb_(fixed<N>(model.joint_values(&Joint::coulomb_friction))),
      external_limit_(fixed<N>(settings.limits.external_torque)),
      gravity_(settings.feed_forward.gravity),
      external_force_(settings.limits.external_force),
      tip_limit_(settings.limits.tip_velocity),
      frozen_after_(0.4 * settings.watchdog.feedback),
      wall_count_(std::min(settings.limits.walls.size(), kMaxWalls)) {
  std::copy_n(settings.limits.walls.begin(), wall_count_, walls_.begin());
  for (int i = 0; i < N; ++i) estimates_ |= std::isfinite(external_limit_[i]);
  reset();
}

template <int N>
void MotionWatch<N>::reset() noexcept {
  first_ = true;
  torques_ = 0;
  tip_speed_ = same_ = 0;
  frozen_ = false;
  for (Vector* vector :
       {&q_, &qd_, &torque_, &external_, &excess_, &before_, &peak_, &last_peak_, &reversals_}) {
    vector->setZero();
  }
  grown_.fill(0);
}

template <int N>
Status MotionWatch<N>::check(const Tick& tick) noexcept {
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  bool fast = false, outside = false;
  for (int i = 0; i < N; ++i) {
    v += tick.qd[i] * column<N>(tick.robot.J, i).template head<3>();
    fast |= std::abs(tick.qd[i]) > velocity_limit_[i];
    outside |= tick.q[i] < lower_[i] || tick.q[i] > upper_[i];
  }
  const double largest = v.cwiseAbs().maxCoeff();  // whose square may overflow
  tip_speed_ = largest > 0 ? largest * (v / largest).norm() : 0;
  Status status = Status::kOk;
  if (collides(tick)) status = Status::kCollision;
  if (grows(tick) || reverses()) status = Status::kInstability;
  if (tip_speed_ > tip_limit_) status = Status::kTipSpeedLimit;
  if (fast) status = Status::kVelocityLimit;
  for (std::size_t k = 0; k < wall_count_; ++k) {
    if (walls_[k].distance(tick.robot.p_BT_B) < 0) status = Status::kWall;
  }
  if (outside) status = Status::kPositionLimit;
  if (frozen(tick)) status = Status::kStateFrozen;
  first_ = false;
  torques_ = 0;
  q_ = tick.q;
  qd_ = tick.qd;
  return status;
}

template <int N>
void MotionWatch<N>::applied(const Vector& torque, const Vector& excess) noexcept {
  for (int i = 0; i < N; ++i) {
    const bool reversed =
        excess[i] * excess_[i] < 0 &&
        std::min(std::abs(excess[i]), std::abs(excess_[i])) > 0.05 * torque_limit_[i];
    reversals_[i] += ((reversed ? 1 : 0) - reversals_[i]) / 64;
  }
  if (++torques_ == 1) {
    torque_ = torque;
  } else {
    add<N>(difference<N>(torque, torque_), torque_, 1.0 / torques_);
  }
  excess_ = excess;
}

template <int N>
bool MotionWatch<N>::collides(const Tick& tick) noexcept {
  if (tick.external_wrench.template head<3>().norm() > external_force_) return true;
  if (!estimates_ || first_) return false;
  constexpr double kTimeConstant = 0.01;  // s
  Vector force = Vector::Zero();          // M qdd
  add_product<N>(tick.robot.M, difference<N>(tick.qd, qd_), force, 1 / tick.dt);
  bool found = false;
  const double share = std::min(1.0, tick.dt / kTimeConstant);
  for (int i = 0; i < N; ++i) {
    const double weight = gravity_ ? tick.robot.gravity[i] : 0;  // or the robot holds it itself
    const double now = force[i] + tick.robot.coriolis[i] + weight - torque_[i];
    external_[i] += share * (now - external_[i]);
    found |= std::abs(external_[i]) > external_limit_[i];
  }
  return found;
}

template <int N>
bool MotionWatch<N>::grows(const Tick& tick) noexcept {
  constexpr int kHalfSwings = 10;
  constexpr double kGrowth = 1.02, kLarge = 0.1;  // of the velocity limit
  bool found = false;
  for (int i = 0; i < N; ++i) {
    const std::size_t at = static_cast<std::size_t>(i);
    if (tick.qd[i] * qd_[i] < 0) {
      const bool larger = peak_[i] > kGrowth * last_peak_[i] && peak_[i] > 1e-6;
      grown_[at] = larger && tick.still ? grown_[at] + 1 : 0;
      last_peak_[i] = peak_[i];
      peak_[i] = 0;
    }
    peak_[i] = std::max(peak_[i], std::abs(tick.qd[i]));
    found |= grown_[at] >= kHalfSwings && peak_[i] > kLarge * velocity_limit_[i];
  }
  return found;
}

template <int N>
bool MotionWatch<N>::reverses() const noexcept {
  for (int i = 0; i < N; ++i) {
    if (reversals_[i] > 0.47) return true;
  }
  return false;
}

template <int N>
bool MotionWatch<N>::frozen(const Tick& tick) noexcept {
  bool same = !first_ && frozen_after_ > 0;
  for (int i = 0; i < N && same; ++i) same = tick.q[i] == q_[i] && tick.qd[i] == qd_[i];
  if (!same) {
    same_ = 0;
    before_ = excess_;
    frozen_ = false;
    return false;
  }
  same_ += tick.dt;
  if (same_ < frozen_after_) return false;
  for (int i = 0; i < N; ++i) {
    const double change = std::abs(excess_[i] - before_[i]);
    frozen_ |= change > 0.05 * torque_limit_[i] + coulomb_[i];
  }
  return frozen_;  // until the state changes, also where the torque is as before again
}

}  // namespace dashpot::controller
