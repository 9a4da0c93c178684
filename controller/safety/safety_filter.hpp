#pragma once
#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/status.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {

/// Returns how late torque acts on what was measured, s: a tick, those of the delay, and the lags
/// of the drives' low-pass and of a differenced velocity.
inline double loop_lag(const Settings& settings) noexcept {
  const Analysis::Sampled& loop = settings.analysis.sampled;
  const double filter = loop.cutoff > 0 ? 1 / (2 * std::numbers::pi * loop.cutoff) : 0;
  return settings.period * (1 + loop.delay + (loop.difference_velocity ? 0.5 : 0)) + filter;
}

/// The last stop of every torque. With w the weight (the gravity torque that the controller
/// compensates, n) the torque is
///     tau = w + r + s x,       x = f(law's torque - w),
/// r being the repulsion of position limits, and keeps
///     |tau_i| <= torque_i   and   |tau_i - last tau_i| <= torque_rate_i T.
///
/// - s <= 1 is one number for all joints: what exceeds the weight shrinks evenly where torques
///   saturate while springs are in force, so that the wrench at the tip keeps its direction. So it
///   does where the power x' qd would be above Limits::power.
/// - f takes away what drives a robot that is about as fast as its limits. With v the largest share
///   of a velocity limit, of a joint or of the tip, x shrinks evenly by (0.9 - v) / 0.25 for v >
///   0.65 where it adds energy (x' qd > 0). And with u = |qd_i| / velocity_i > 0.5 what drives a
///   joint is bounded so that the torque-rate limit can still take it away in time:
///     x_i <= min(sqrt(torque_rate_i I_i d), 0.4 I_i d / lag) + torque_i max(0, 0.65 - u) / 0.15,
///     d = 0.9 velocity_i - |qd_i|.
///   So nothing but the weight drives a joint further that moves at 0.9 of its limit or more, or
///   adds energy to a robot whose tip does.
/// - Near a position limit, with m the margin, g the distance to the limit and y = (m - g) / m
///   between 0 and 1, f bounds the law's torque toward the limit by E_i g / m, and the repulsion is
///     r_i = -F_i y^2 - c_i y qd_i     (away from an upper limit),
///   a spring and a damper that the sampled loop bears whatever else is at its limit:
///     c_i = 0.4 I_i / lag,   F_i = min(Limits::repulsion torque_i, c_i velocity_i / 10),
///     E_i = min(torque_i, 0.2 I_i m / lag^2).
///   So a joint that it pushes back is no faster than a tenth of its velocity limit. F_i counts
///   only while springs are in force.
/// - Outside a position limit no spring acts. If the joint `returns`, the torque is that of a
///   damper that moves inward:
///     r_i = c_i (return_velocity_i z - qd_i), |r_i| <= F_i, z growing from 0 to 1 within a second.
///   Otherwise z = 0.
///
/// I_i is least_joint_inertia, lag is loop_lag: delays make all this weaker, not unstable.
///
/// Where springs end or start again, what the last torque has beyond the new one fades evenly: in
/// all joints alike, in the least time in which no joint's rate limit has to act on it. Otherwise
/// joints with little torque would let go first, and turn the wrench that the tip exerts.
template <int N>
class SafetyFilter {
 public:
  using Vector = Joints<N>;

  /// What the robot does at this tick.
  struct Motion {
    const Vector& q;
    const Vector& qd;
    double tip_speed;  ///< m/s
    bool springs;      ///< are in force, and so are those of the repulsion
    bool returns;      ///< joints outside their limits are to return
  };

  /// `inertia`: I, n, kg m^2.
  SafetyFilter(const Settings& settings, const Vector& inertia) noexcept;

  /// Forgets the past. The next torque continues the last one.
  void restart() noexcept;
  /// Forgets the past; `torque` is what acts now.
  void reset(const Vector& torque) noexcept {
    for (int i = 0; i < N; ++i) last_[i] = std::clamp(torque[i], -torque_[i], torque_[i]);
    known_ = true;
    restart();
  }
  /// As long as nothing is known of the torque that acts: it is the weight.
  void assume(const Vector& weight) noexcept {
    if (!known_) reset(weight);
  }
  /// The next torque to be applied does not continue the last: the difference fades evenly.
  void begin_anew() noexcept { anew_ = true; }

  /// Makes a torque safe, in place. Returns kOk, kTorqueLimited, kNearJointLimit, kWeightNotHeld,
  /// or kNotFinite, and then sets what `ramp` gives.
  Status apply(const Motion& motion, const Vector& weight, Vector& tau) noexcept;

  /// Where nothing is known: the last torque goes evenly to zero within 0.1 s, or as fast as the
  /// rate limits allow.
  Vector ramp() noexcept;

  /// Returns what the last `apply` was given, before the limits.
  const Vector& asked() const noexcept { return asked_; }
  /// Returns what the last `apply` or `ramp` put out.
  const Vector& last() const noexcept { return last_; }
  /// True if repulsion acts at q; it then has this stiffness and damping, N m/rad and N m s/rad.
  bool repels(const Vector& q, bool springs, Vector& stiffness, Vector& damping) const noexcept;
  /// Dampers (n, N m s/rad), each no larger than what the sampled loop bears twice.
  Vector borne(Vector damping) const noexcept {
    for (int i = 0; i < N; ++i) damping[i] = std::min(damping[i], 2.5 * damper_[i]);
    return damping;
  }

 private:
  static constexpr double kRampTime = 0.1;    // s
  static constexpr double kLeastRoom = 0.05;  // of a torque limit
  static constexpr double kReturnRise = 1;    // s
  static constexpr double kFull = 0.9;        // of a velocity limit: nothing drives further
  static constexpr double kFirst = 0.5;       // from here on the drive is bounded ...
  static constexpr double kWholly = 0.65;     // ... and from here on to what can be taken away

  /// Distance to the nearer limit, and the sign of the way to it.
  struct Near {
    double distance;
    double toward;
  };
  Near nearer(int i, double q) const noexcept {
    const double below = q - lower_[i], above = upper_[i] - q;
    return below < above ? Near{below, -1} : Near{above, 1};
  }
  /// Sets `repulsion`, and bounds the `excess` toward limits.
  Status repel(const Motion& motion, Vector& excess, Vector& repulsion) noexcept;
  /// Bounds what drives a robot that moves with the share `fastest` of a velocity limit. True if
  /// that changed anything.
  bool hold_back(const Vector& qd, double fastest, Vector& excess) const noexcept;
  /// Scales `excess` for the limits of power and of torque beyond `base`. True if it did.
  bool shrink(const Vector& qd, const Vector& base, Vector& excess) const noexcept;
  bool fade(Vector& tau) noexcept;
  bool limit(Vector& tau) noexcept;

  Vector torque_;       ///< limits, N m
  Vector torque_step_;  ///< limits of its change in one tick, N m
  Vector velocity_;     ///< limits, rad/s
  Vector lower_;        ///< limits, rad
  Vector upper_;
  Vector margin_;
  Vector return_velocity_;
  Vector damper_;        ///< c
  Vector repulsion_;     ///< F
  Vector toward_;        ///< E
  Vector late_;          ///< torque_rate I, of f
  Vector per_velocity_;  ///< s/rad
  double per_tip_velocity_;
  double power_;
  double ramp_share_;     ///< of the torque, in one tick
  double return_step_;    ///< of z
  double returning_ = 0;  ///< z
  Vector last_ = Vector::Zero();
  Vector asked_ = Vector::Zero();
  bool known_ = false;
  bool ramping_ = false;
  Vector ramp_step_ = Vector::Zero();
  bool anew_ = true;
  Vector left_ = Vector::Zero();  ///< of the torque before `begin_anew`, N m
  double share_ = 0;              ///< of it that is still there
  double share_step_ = 1;         ///< in one tick
};

}  // namespace dashpot::controller
