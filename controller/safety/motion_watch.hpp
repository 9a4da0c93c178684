#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <array>

namespace dashpot::controller {

/// Notices conditions with which an arm must not continue: the statuses that latch. Each tick with
/// a good state is passed to `check`, and the torque of every tick to `applied`.
///
/// - kCollision: the external torque r, estimated with a time constant of 10 ms from
///       r <- r + T / 10 ms (M (qd - last qd) / T + coriolis + gravity - tau - r),
///   tau being the mean of what was applied meanwhile, or the force at the tip that the robot
///   reports, is above its threshold. Without a threshold for a joint nothing is computed.
/// - kInstability: a joint swings to and fro with a velocity that grows by 2 % or more with each of
///   ten half swings, to more than a tenth of its limit, while the springs stand still; or it
///   vibrates with more than about a fifth of its limit for 0.4 s, in at least ten half swings of
///   at most 90 ms, whatever the springs do, which is faster than a person shakes; or the torque
///   beyond the weight reverses, at more than a twentieth of its limit, in every tick for 40 ticks,
///   or in every other tick for 180.
/// - kStateFrozen: position and velocity stay the same to the last bit for 0.4 times
///   Watchdog::feedback
/// although that torque has since changed by more than stiction explains; or for 40 ms in which the
/// velocity would have moved a joint by 0.1 mrad (0.1 mm) and more than a count of its encoder.
/// Stiction is a twentieth of the torque limit and three times the model's Coulomb friction, or 15
/// % of the limit if the model has no friction.
/// - kBrakeDoubted: the arm gains energy that the torque does not give it. While no springs act,
///       s <- max(0, s + dE - x' qd dt - (0.4 |x_i qd_i| + 0.3 |gravity_i qd_i| + 35 N v_tip) dt),
///   E being the kinetic energy and x the torque beside the weight, exceeds the energy of joints
///   with half of their velocity limits, each by itself, and has grown for 30 ms since: a blow ends
///   sooner. This finds motors that are weak, dead or reversed although gravity explains much, and
///   ignores wrong masses, friction, a payload and a push by hand, which explain less. Below that
///   kinetic energy s decays with 50 ms.
class MotionWatch {
 public:
  MotionWatch(const RobotModel& model, const Settings& settings) noexcept;
  void reset() noexcept;

  struct Tick {
    double dt;  ///< since the last one, s
    const JointVector& q;
    const JointVector& qd;
    const DynamicsResult& robot;
    const Vector6& external_wrench;
    bool still;   ///< the springs stand still
    bool brakes;  ///< no springs have acted since the last tick
  };
  /// Returns kOk, or the worst of the statuses kCollision to kBrakeDoubted that holds now.
  Status check(const Tick& tick) noexcept;
  /// Records a torque that is applied beside a weight.
  void applied(const JointVector& torque, const JointVector& weight) noexcept;

  /// Counts swings and reversals again from zero.
  void forget_swings() noexcept;

  /// True as long as the state is frozen, so that its velocity means nothing.
  bool sees_frozen() const noexcept { return frozen_; }
  /// Sets the limit of the tip's speed, m/s.
  void limit_tip_speed(double limit) noexcept { tip_limit_ = limit; }
  /// Returns the tip's speed at the last tick, m/s.
  double tip_speed() const noexcept { return tip_speed_; }

 private:
  bool collides(const Tick& tick) noexcept;
  bool frozen(const Tick& tick) noexcept;
  /// True if the arm has gained more energy than the torque explains.
  bool gains(const Tick& tick) noexcept;

  /// What is known of a joint.
  struct Record {
    double lower, upper;    ///< limits, rad
    double velocity_limit;  ///< rad/s
    double torque_limit;    ///< N m
    double stiction;        ///< change of torque that it may take up, N m
    double external_limit;  ///< N m

    double count = 2e-3;   ///< least observed change of q, rad; at first a 12-bit encoder's
    double q = 0, qd = 0;  ///< of the last tick
    double torque = 0, beside = 0;   ///< applied since, the mean, and its part beside the weight
    double excess = 0;               ///< of the torque over the weight, applied since
    double before = 0;               ///< excess when the state was last seen to change
    double external = 0;             ///< r
    double peak = 0, last_peak = 0;  ///< of |qd| in this half swing and the last
    double reversals = 0;            ///< share of the last ticks
    int grown = 0;                   ///< half swings, one larger than the other
    double slow = 0, fast = 0;       ///< qd, smoothed over 50 ms, and the rest of it
    double swing = 0, height = 0;    ///< duration and height of this half swing of `fast`
    double vibrating = 0;            ///< for how long half swings have been fast and high, s
    int swings = 0;                  ///< number of these half swings

    /// Counts half swings. Returns true if the joint swings with a growing velocity.
    bool grows(double now, bool still) noexcept;
    /// Returns true if the joint vibrates; `slow` moves by a `share` of the way to qd.
    bool vibrates(double now, double dt, double share) noexcept;
  };
  Record& joint(Eigen::Index i) noexcept { return joints_[static_cast<std::size_t>(i)]; }

  Eigen::Index n_;
  bool estimates_ = false;  ///< the external torque
  bool gravity_;            ///< is compensated here
  double external_force_;
  double tip_limit_;
  double frozen_after_;
  bool first_ = true;
  bool frozen_ = false;
  int torques_ = 0;  ///< number applied since the last tick
  double tip_speed_ = 0;
  double same_ = 0;      ///< time since the state changed, s
  double strained_ = 0;  ///< part of it in which the torque exceeded stiction, s
  double energy_ = -1;   ///< kinetic, J; negative: the last tick had springs
  double gained_ = 0;    ///< s, J
  double gaining_ = 0;   ///< time for which s_ was too large and grew, s
  std::size_t wall_count_;
  std::array<Record, kMaxJoints> joints_;
  std::array<Wall, kMaxWalls> walls_;
};

}  // namespace dashpot::controller
