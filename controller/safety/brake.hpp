#pragma once
#include <dashpot/controller/base/small_cholesky.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <array>

namespace dashpot::controller {

/// Returns how late torque acts on what was measured, s: a tick, those of the delay, and the lags
/// of the drives' low-pass and of a differenced velocity.
double loop_lag(const Settings& settings) noexcept;

/// Stops the arm, and keeps each joint within an interval of allowed velocity.
///
/// With D = M / T every motion decays with the time constant T, whatever the posture and however
/// light a joint, because M^-1 D = I / T. A sampled loop that acts d ticks late bears it as long as
/// T > period / (2 sin(pi / (4 d + 2))), so its gain margin is about 2 T / (period (1 + 2 d)). T is
/// Limits::stopping_time, or what leaves a margin of about kMargin, if that is longer.
///
/// `stop` wants the velocity zero, or the return velocity v_r outside a position limit:
///     b = M (v_wanted - qd) / T.
/// Where torque limits do not leave room for b it shrinks b in all joints alike, to s b, which
/// speeds up no joint. If b clipped joint by joint takes more energy from the arm, it goes from s b
/// toward that as far as no joint is sped up beyond 0.9 of its velocity limit: what the others are
/// braked with can drive a light joint. So what stops the arm at v_wanted = 0 never feeds it, as
/// far as qd is right: both take energy, s b the power s qd' M qd / T.
///
/// `hold` leaves a torque x in excess of the weight as it is unless it would take a joint out of
/// its interval [-v-_i, v+_i]. With t = T / 5 (or what
/// leaves a margin of 3), the distance d_i to a position limit less a margin,
/// the acceleration a_i = room_i / (2 M_ii) of half of the torque that the weight leaves, and the
/// time r_i = max(4 t, t + lag + torque_i / torque_rate_i) until it is there,
///     v+_i = min(0.9 velocity_i, sqrt((a_i r_i)^2 + 2 a_i d_i) - a_i r_i),  d_i / r_i if d_i < 0,
/// from which the joint stops before the limit, and likewise v-_i. The acceleration M^-1 (x -
/// coriolis) of the model may be at most
///     min((v+_i - qd_i) / t, sqrt(2 (v+_i - qd_i) torque_rate_i / M_ii) / s_i)
/// and likewise downward, the latter only where the joint moves that way already, with the share
/// s_i = min(1, 2 |qd_i| / v+_i): braking is not bounded, nor what presses. It vanishes at
/// the edge, is negative beyond it, and can be taken away as fast as the torque-rate limit allows.
/// By Gauss's principle of least constraint hold adds to x the torques of the fewest joints, with
/// the sign of a brake, that keep these bounds: torques on the joints at their bounds alone. The
/// others keep the torque that x gives them.
class Brake {
 public:
  explicit Brake(const Settings& settings) noexcept;

  struct Motion {
    const JointVector& q;
    const JointVector& qd;
    const DynamicsResult& robot;
    const JointVector& weight;  ///< that is compensated here
    const SmallCholesky* mass;  ///< factor of robot.M, if anybody has it already; or null
  };

  /// Returns b, n, N m, within the torque limits beside the weight. `inward` scales the velocity of
  /// joints outside their position limits back to them, 0 to 1.
  JointVector stop(const Motion& motion, double inward) noexcept;
  /// Bounds `excess`. Returns kOk, kTorqueLimited, or kNearJointLimit.
  Status hold(const Motion& motion, JointVector& excess) noexcept;

  /// Returns T, s.
  double stopping_time() const noexcept { return stopping_time_; }

 private:
  /// Limits and delays of one joint.
  struct Bounds {
    double lower, upper;  ///< position limits less the margin, rad
    double outermost;     ///< the margin, rad
    double velocity;      ///< limit, rad/s
    double torque;        ///< limit, N m
    double torque_rate;   ///< limit, N m/s
    double reaction;      ///< r, s
    double per_rate;      ///< 1 / (2 torque_rate), s/(N m)
  };
  /// The acceleration that a joint may have in one direction.
  struct Bound {
    Eigen::Index joint;
    double way;           ///< 1 or -1
    double acceleration;  ///< rad/s^2
    bool at_limit;        ///< because of a position limit
  };
  /// A joint at its bound, and the torque that keeps it there.
  struct Held {
    Bound bound;
    double torque = 0;   ///< N m
    JointVector column;  ///< of M^-1
  };

  const Bounds& joint(Eigen::Index i) const noexcept {
    return joints_[static_cast<std::size_t>(i)];
  }
  Held& held(Eigen::Index k) noexcept { return held_[static_cast<std::size_t>(k)]; }
  /// Sets the factor of M for this tick.
  void factor(const Motion& motion) noexcept;
  double distance(const Motion& motion, Eigen::Index i, double way) const noexcept;
  double braking_torque(const Motion& motion, Eigen::Index i) const noexcept;
  /// True if an acceleration is far from the bounds of both directions, which is soon told.
  bool at_ease(const Motion& motion, Eigen::Index i, double acceleration) const noexcept;
  Bound bound(const Motion& motion, Eigen::Index i, double way) const noexcept;
  bool holds(Eigen::Index i) const noexcept;
  /// torque <- M^-1 torque
  void accelerate(JointVector& torque) const noexcept;
  void add_held(const Bound& bound) noexcept;
  /// Sets the torques with which those held are at their bounds. Those that would have to be driven
  /// there are let go.
  void solve(const JointVector& free) noexcept;

  Eigen::Index n_;
  double stopping_time_;  ///< T
  double near_;           ///< t
  SmallCholesky own_mass_;
  const SmallCholesky* mass_ = nullptr;  ///< of this tick
  SmallCholesky constrained_;
  Eigen::Index count_ = 0;  ///< of those held
  std::array<Held, kMaxJoints> held_;
  std::array<Bounds, kMaxJoints> joints_;
};

}  // namespace dashpot::controller
