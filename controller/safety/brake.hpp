#pragma once
#include <dashpot/controller/base/small_cholesky.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <Eigen/Cholesky>
#include <array>
#include <limits>

namespace dashpot::controller {

/// Returns the delay from a measurement to its torque, s: a tick, the delay in ticks, and the lags
/// of the drives' low-pass and of a differenced velocity.
double loop_lag(const Settings& settings) noexcept;

/// Stops the arm, and keeps each joint within an interval of allowed velocity.
///
/// With D = M / T every motion decays with the time constant T, whatever the posture and however
/// light a joint, because M^-1 D = I / T. A sampled loop that acts d ticks late is stable as long
/// as T > period / (2 sin(pi / (4 d + 2))), so its gain margin is about 2 T / (period (1 + 2 d)). T
/// is Limits::stopping_time, or the T with a margin of about kMargin, if that is longer. A T that
/// elastic joints do not tolerate is refused (see gears_stopping_time).
///
/// `stop` wants the velocity zero, or the return velocity v_r outside a position limit:
///     x = c M (v_wanted - qd),   c = min(1 / T, min_i 2 / (lag + sqrt(lag^2 + 2 |p_i| / R_i))),
/// with the momentum p = M (v_wanted - qd) and the torque-rate limit R. A torque t that goes to
/// zero at the rate R takes t^2 / (2 R) more of the momentum, and t lag meanwhile; the second bound
/// is the c from which the brake can let go before any of p is used up. So a slow torque rate makes
/// a stop longer, and drives no arm back.
///
/// Once the arm stands, `stop` holds it. It stands if each joint is slower than 3 % of its velocity
/// limit, or gets faster than it was by that much. From then on, with v the velocity smoothed over
/// T / 10,
///     x = c M (v_wanted - v) + r,   r <- r - (2/9) c^2 M (q - last q).
/// So r is a spring M 2 / (9 T^2) about the posture where the arm stood. It never drifts, because
/// differences of positions add up; with c = 1 / T all motion decays with 3 T and 3/2 T. A stiffer
/// spring vibrates if states are 30 ms late. An unknown torque e moves the arm by (9/2) T^2 M^-1 e.
/// r is bounded to half of the torque limit in each joint: a person who pushes harder moves the
/// arm, the held posture moves along, and after release the arm springs back by the deflection of
/// r. Likewise a joint slips in which r and the weight take the whole torque limit, or which is
/// faster than half of its velocity limit against its whole torque: its way adds nothing to r,
/// which would drive other joints in its place. r waits while the springs' torque fades, and fades
/// with a time constant of half a second while the motion is not observed. A joint on its way back
/// from outside a limit adds to r only where it moves outward. A larger inertia than the model's
/// makes the hold softer and less damped; no smaller gain makes it unstable, so it needs no second
/// integral.
///
/// A brake whose velocities are late, or whose model is wrong, may drive the arm back or shake it.
/// `watch` softens such a brake: if the kinetic energy, with the mean of qd and v, in
/// which noise counts less than a shake, fell by half and rises again by a tenth of its first
/// value, before the arm stands, T is doubled, up to eight times, until springs act again. It also
/// doubts the brake: the energy may exceed its least value since the stop began or was softened by
/// the most that the weight can have added, int (|w_i| + |r_i|) |qd_i| dt over about half a second,
/// as if all of it were held wrongly, and by the energy of joints with half of their velocity
/// limits (at least 1 rad/s), each by itself, because a person may push.
///
/// `constrain` finds the torque x' in excess of the weight w nearest to a desired torque x, in the
/// sense of Gauss's principle of least constraint,
///     (x' - x)' M^-1 (x' - x) -> min,
/// that keeps the limits of torque and, from the last torque on, of torque rate,
///     max(-torque_i, last_i - rate_i T) <= w_i + x'_i <= min(torque_i, last_i + rate_i T),
/// and takes no joint out of its interval [-v-_i, v+_i]. Joints whose torque is at no limit keep
/// the acceleration that x gives them, or their bound. With x of `stop`, v_wanted = 0 and limits
/// that allow x' = 0, x' takes energy from the arm as far as qd is right: at least
/// (T / 2) x'' M^-1 x'.
///
/// With t = T / 5 (or the t with a margin of 3; with elastic joints the least T that they
/// tolerate), the distance d_i to a position limit less a margin, the acceleration a_i = room_i /
/// (2 M_ii) of half of the torque that the weight leaves, and the time r_i = max(4 t, t + lag +
/// torque_i / torque_rate_i) until it acts,
///     v+_i = min(0.85 velocity_i, sqrt((a_i r_i)^2 + 2 a_i d_i) - a_i r_i),  d_i / r_i if d_i < 0,
/// from which the joint stops before the limit, and likewise v-_i. While the law acts, the
/// acceleration M^-1 (x' - coriolis) of the model may be at most
///     min((v+_i - qd_i) / t, sqrt(2 (v+_i - qd_i) torque_rate_i / M_ii) / s_i)
/// and likewise downward, the latter only if the joint moves that way already, with the share s_i =
/// min(1, 2 |qd_i| / v+_i): neither braking nor pressing is bounded. The bound is zero at the edge,
/// negative beyond it, and its torque can be taken away as fast as the torque-rate limit allows. In
/// a stop M^-1 x' may be at most max(0, (v+_i - qd_i) / t), with v+_i at least 0: the torque that
/// brakes the others moves no joint to its limits. The limits of torque take precedence.
class Brake {
  using BoundMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor,
                                    2 * kMaxJoints, 2 * kMaxJoints>;

 public:
  /// `gears` is the least T that elastic joints tolerate, s; 0: no joint is elastic.
  explicit Brake(const Settings& settings, double gears = 0) noexcept;

  struct Motion {
    const JointVector& q;
    const JointVector& qd;
    const DynamicsResult& robot;
    const JointVector& weight;  ///< that Dashpot compensates
    const SmallCholesky* mass;  ///< factor of robot.M, or null if it is unknown
  };

  /// Change of the resistance in a tick.
  enum class Resistance : std::uint8_t {
    kWaits,  ///< stays as it is
    kGrows,  ///< against the motion of a standing joint
    kFades,  ///< because its effect is not observed
  };
  /// Returns x, n, N m. `inward` scales the velocity of joints outside their position limits back
  /// to them, 0 to 1.
  JointVector stop(const Motion& motion, double inward,
                   Resistance resistance = Resistance::kWaits) noexcept;
  /// Sets `excess` x to x', `last` being the torque of the last tick, n, N m; `stops` if it is one
  /// of `stop`. Returns kOk, kTorqueLimited, or kNearJointLimit.
  Status constrain(const Motion& motion, const JointVector& last, bool stops,
                   JointVector& excess) noexcept;

  /// Records which joints x' = `excess` of the last `stop` takes to their torque limits.
  void limited(const Motion& motion, const JointVector& excess) noexcept;
  /// Records a motion in which a stop acts alone.
  void watch(const Motion& motion) noexcept;
  /// True if a stop has added energy to the arm since springs last acted.
  bool feeds() const noexcept { return feeds_; }
  /// Doubles T. Returns false if T has its largest value.
  bool soften() noexcept;
  /// Ends a stop.
  void firm() noexcept;
  /// Forgets the observed motion, because it was interrupted.
  void forget() noexcept;
  /// Releases the held posture.
  void let_go() noexcept;
  /// Returns M^-1 (x' - r) of the last stop, rad/s^2: the deceleration according to the model,
  /// because r holds what the model does not know.
  const JointVector& slowing() const noexcept { return slowing_; }
  /// Returns T as it is now, s.
  double stopping_time() const noexcept { return softness_ * stopping_time_; }

 private:
  /// Limits and delays of one joint.
  struct Bounds {
    double lower, upper;  ///< position limits less the margin, rad
    double outermost;     ///< the margin, rad
    double velocity;      ///< limit, rad/s
    double torque;        ///< limit, N m
    double torque_rate;   ///< limit, N m/s
    double torque_step;   ///< limit of its change in a tick, N m
    double reaction;      ///< r, s
    double per_rate;      ///< 1 / (2 torque_rate), s/(N m)

    double slowest = 0;     ///< least speed lately, rad/s
    double resistance = 0;  ///< r, N m
    double full = 0;        ///< the torque, if it is at its limit, N m, or 0
  };
  /// Bound of a joint in one direction.
  struct Bound {
    enum class Of : std::uint8_t { kTorque, kAcceleration };
    Eigen::Index joint;
    Of of;
    double way;     ///< 1 or -1
    double value;   ///< N m or rad/s^2
    bool at_limit;  ///< because of a position limit
  };
  /// A joint at its bound. A torque s unit' M of all joints accelerates it alone, and a torque s
  /// unit accelerates all joints by s M^-1 unit.
  struct Held {
    Bound bound;
    JointVector column = {};  ///< of M or M^-1
    double scale = 1;         ///< s, with which the factors' matrix has a diagonal of ones
    double factor = 0;        ///< of the torque or acceleration that keeps it there
  };

  const Bounds& joint(Eigen::Index i) const noexcept {
    return joints_[static_cast<std::size_t>(i)];
  }
  Held& held(Eigen::Index k) noexcept { return held_[static_cast<std::size_t>(k)]; }
  Bounds& joint(Eigen::Index i) noexcept { return joints_[static_cast<std::size_t>(i)]; }
  /// Returns the greatest c of a brake c M v, 1/s, whose torque can return to zero before the
  /// `momentum` M v is used up.
  double fastest(const JointVector& momentum) const noexcept;
  /// Updates which joints stand, and r.
  void resist(const Motion& motion, const JointVector& wanted, double stiffness) noexcept;
  /// Sets the factor of M for this tick.
  void factor(const Motion& motion) noexcept;
  double distance(const Motion& motion, Eigen::Index i, double way) const noexcept;
  /// Returns the torque limit less the weight, N m.
  double held_weight(const Motion& motion, Eigen::Index i) const noexcept;
  /// Returns how much r may still change in a direction, N m.
  double resistance_left(const Motion& motion, Eigen::Index i, double way) const noexcept;
  double braking_torque(const Motion& motion, Eigen::Index i) const noexcept;
  /// Values of an earlier tick. A change d of the torque changes (M^-1 torque)_i by at most r_i sum
  /// r_j |d_j| with r_i^2 = (M^-1)_ii. As long as that stays far from all bounds, and posture and
  /// attachment are about the same, no M has to be factored.
  struct Known {
    JointVector q, response;           ///< where M was factored; r
    double inertia = 0;                ///< trace of M there
    JointVector torque, acceleration;  ///< in excess of the weight and M qdd
  };
  bool known_nearby(const Motion& motion) const noexcept;
  bool all_at_ease(const Motion& motion, const JointVector& torque) const noexcept;
  void respond(const Motion& motion) noexcept;
  /// True if a quick test shows that an acceleration is far from the bounds of both directions.
  bool at_ease(const Motion& motion, Eigen::Index i, double acceleration) const noexcept;
  Bound acceleration_bound(const Motion& motion, Eigen::Index i, double way,
                           bool stops) const noexcept;
  Bound torque_bound(const Motion& motion, const JointVector& last, Eigen::Index i,
                     double way) const noexcept;
  /// Keeps the bounds of torque joint by joint. True if that changed anything.
  bool clip(const Motion& motion, const JointVector& last, JointVector& excess) const noexcept;
  bool holds(const Bound& bound) const noexcept;
  /// torque <- M^-1 torque
  void accelerate(JointVector& torque) const noexcept;
  void hold(const Motion& motion, const Bound& bound) noexcept;
  void let_go(Eigen::Index k) noexcept;
  /// Sets the factor of the matrix of the held joints. Returns false if rounding errors prevent it.
  bool factor_held() noexcept;
  /// Sets the factors with which the held joints are at their bounds, and releases joints that
  /// would have to be driven there.
  void solve(const JointVector& torque, const JointVector& acceleration) noexcept;

  Eigen::Index n_;
  double stopping_time_;  ///< T
  double near_;           ///< t
  double lag_;
  double period_;
  double softness_ = 1;                                     ///< of this stop, a factor of T
  double most_ = 0;                                         ///< kinetic energy in this stop, J
  double least_ = std::numeric_limits<double>::infinity();  ///< likewise, since it was softened
  double given_ = 0;                                        ///< by the weight, J
  bool fell_ = false;
  bool feeds_ = false;
  bool stands_ = false;  ///< so that motion is resisted
  bool seen_ = false;    ///< q_ belongs to the tick before
  JointVector q_, v_;    ///< v: qd, smoothed
  JointVector slowing_;
  Known known_;
  SmallCholesky own_mass_;
  const SmallCholesky* mass_ = nullptr;  ///< of this tick
  Eigen::LLT<BoundMatrix> constrained_{2 * kMaxJoints};
  Eigen::Index count_ = 0;  ///< of held joints
  std::array<Held, static_cast<std::size_t>(2 * kMaxJoints)> held_;
  std::array<Bounds, kMaxJoints> joints_;
};

}  // namespace dashpot::controller
