#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <array>

namespace dashpot::controller {

/// Notices what an arm must not go on with: see the statuses that latch. Each tick is given to
/// `check`, if its state is good, and the torque that comes of it to `applied` in any case.
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
/// - kStateFrozen: position and velocity stay the same to the last bit although that torque has
///   changed, since a bit last did, by more than stiction explains, for 0.4 times
///   Watchdog::feedback; or for 40 ms, in which the velocity would have moved a joint by 0.1 mrad
///   (0.1 mm) and more than a count of its encoder. Stiction takes up a twentieth of the torque
///   limit and three times the model's Coulomb friction, or 15 % of the limit where the model has
///   none.
/// - kBrakeDoubted: the arm gains energy that the torque does not give it. While no springs act,
///       s <- max(0, s + dE - x' qd dt - (0.4 |x_i qd_i| + 0.3 |gravity_i qd_i| + 35 N v_tip) dt),
///   E being the kinetic energy and x the torque beside the weight, exceeds the energy of joints
///   with half of their velocity limits, each by itself, and has grown for 30 ms since: a blow
///   ends sooner. So motors that are weak, dead or reversed
///   are found however much gravity explains, and what is wrong by less is not: masses, friction, a
///   payload, a push by hand. Below that kinetic energy s decays with 50 ms.
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
  /// Takes note of a torque that is applied beside a weight.
  void applied(const JointVector& torque, const JointVector& weight) noexcept;

  /// Swings and reversals are counted anew.
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

    double count = 2e-3;  ///< least change of q that was seen, as of a 12-bit encoder at first, rad
    double q = 0, qd = 0;            ///< of the last tick
    double torque = 0, beside = 0;   ///< applied since, the mean, and that beside the weight
    double excess = 0;               ///< of the torque over the weight, applied since
    double before = 0;               ///< excess when the state was last seen to change
    double external = 0;             ///< r
    double peak = 0, last_peak = 0;  ///< of |qd| in this half swing and the last
    double reversals = 0;            ///< share of the last ticks
    int grown = 0;                   ///< half swings, one larger than the other
    double slow = 0, fast = 0;       ///< qd, smoothed over 50 ms, and the rest of it
    double swing = 0, height = 0;    ///< how long this half swing of `fast` has been, and how high
    double vibrating = 0;            ///< for how long half swings have been fast and high, s
    int swings = 0;                  ///< how many these were

    /// Counts half swings. True if the joint swings with a velocity that grows.
    bool grows(double now, bool still) noexcept;
    /// True if the joint vibrates; `slow` goes by a `share` of the way to qd.
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
  int torques_ = 0;  ///< how many were applied since the last tick
  double tip_speed_ = 0;
  double same_ = 0;      ///< for how long the state has not changed, s
  double strained_ = 0;  ///< for how long, meanwhile, the torque has exceeded stiction, s
  double energy_ = -1;   ///< kinetic, J; negative: the last tick had springs
  double gained_ = 0;    ///< s, J
  double gaining_ = 0;   ///< for how long it has been too large and has grown, s
  std::size_t wall_count_;
  std::array<Record, kMaxJoints> joints_;
  std::array<Wall, kMaxWalls> walls_;
};

}  // namespace dashpot::controller
