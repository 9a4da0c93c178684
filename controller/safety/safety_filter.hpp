#pragma once
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/status.hpp>

#include <array>

namespace dashpot::controller {

/// Returns how late torque acts on what was measured, s: a tick, those of the delay, and the lags
/// of the drives' low-pass and of a differenced velocity.
double loop_lag(const Settings& settings) noexcept;

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
/// Where springs end or start again, x goes from what acts to what is asked for evenly: by the same
/// share of the way in all joints, the largest in which no joint's rate limit has to act on it.
/// Otherwise joints with little torque would let go first, and turn the wrench that the tip exerts.
/// It takes as many ticks as the joint with the longest way needed at first. The repulsion does not
/// wait for it, nor does what drives a joint that is faster than its limit.
class SafetyFilter {
 public:
  /// What the robot does at this tick.
  struct Motion {
    const JointVector& q;
    const JointVector& qd;
    double tip_speed;  ///< m/s
    bool springs;      ///< are in force, and so are those of the repulsion
    bool returns;      ///< joints outside their limits are to return
  };

  /// `inertia`: I, n, kg m^2.
  SafetyFilter(const Settings& settings, const JointVector& inertia) noexcept;

  /// Forgets the past. The next torque continues the last one.
  void restart() noexcept;
  /// Forgets the past; `torque` is what acts now.
  void reset(const JointVector& torque) noexcept;
  /// As long as nothing is known of the torque that acts: it is the weight.
  void assume(const JointVector& weight) noexcept {
    if (!known_) reset(weight);
  }
  /// The next torque to be applied does not continue the last: the difference fades evenly.
  void begin_anew() noexcept { anew_ = true; }

  /// Sets the limit of the tip's speed, m/s, above zero.
  void limit_tip_speed(double limit) noexcept { per_tip_velocity_ = 1 / limit; }

  /// Makes a torque safe, in place. Returns kOk, kTorqueLimited, kNearJointLimit, kWeightNotHeld,
  /// or kNotFinite, and then sets what `ramp` gives.
  Status apply(const Motion& motion, const JointVector& weight, JointVector& tau) noexcept;

  /// Where nothing is known: the last torque goes evenly to zero within 0.1 s, or as fast as the
  /// rate limits allow.
  void ramp(JointVector& tau) noexcept;

  /// Returns what the last `apply` was given, before the limits.
  const JointVector& asked() const noexcept { return asked_; }
  /// Returns what the last `apply` or `ramp` put out.
  const JointVector& last() const noexcept { return last_; }
  /// True if repulsion acts at q.
  bool repels(const JointVector& q) const noexcept;
  /// Adds the stiffness and damping of the repulsion at q, N m/rad and N m s/rad.
  void add_repulsion(const JointVector& q, bool springs, JointMatrix& stiffness,
                     JointMatrix& damping) const noexcept;
  /// Dampers (n, N m s/rad), each no larger than what the sampled loop bears twice.
  JointVector borne(JointVector damping) const noexcept;

 private:
  /// What is known of a joint; first what every tick reads.
  struct Bounds {
    double lower, upper;   ///< limits, rad
    double margin;         ///< rad
    double per_velocity;   ///< 1 / velocity, s/rad
    double torque;         ///< limit, N m
    double torque_step;    ///< limit of its change in one tick, N m
    double acting = 0;     ///< x of the last torque, while it fades, N m
    double ramp_step = 0;  ///< N m
    double velocity;       ///< limit, rad/s
    double return_velocity;
    double damper;     ///< c
    double repulsion;  ///< F
    double toward;     ///< E
    double late;       ///< torque_rate I, of f

    /// Distance to the nearer limit, and the sign of the way to it.
    struct Near {
      double distance;
      double toward;
    };
    Near nearer(double q) const noexcept {
      const double below = q - lower, above = upper - q;
      return below < above ? Near{below, -1} : Near{above, 1};
    }
  };

  Bounds& joint(Eigen::Index i) noexcept { return joints_[static_cast<std::size_t>(i)]; }
  const Bounds& joint(Eigen::Index i) const noexcept {
    return joints_[static_cast<std::size_t>(i)];
  }
  /// Sets `repulsion`, and bounds the `excess` toward limits.
  Status repel(const Motion& motion, JointVector& excess, JointVector& repulsion) noexcept;
  /// Bounds what drives a robot that moves with the share `fastest` of a velocity limit. True if
  /// that changed anything.
  bool hold_back(const JointVector& qd, double fastest, JointVector& excess) const noexcept;
  /// Scales `excess` for the limits of power and of torque beyond `base`. True if it did.
  bool shrink(const JointVector& qd, const JointVector& base, JointVector& excess) const noexcept;
  /// Splits the last torque into `weight`, the repulsion in `base` as far as it acted already, and
  /// what fades.
  void take_over(const JointVector& base, const JointVector& weight) noexcept;
  /// Moves from the excess that acts toward `excess`, within the torque limits beyond `base`, and
  /// returns it there. True if there is a way
  /// left.
  bool fade(const JointVector& qd, const JointVector& base, JointVector& excess) noexcept;
  /// Bounds the finite `tau` and its change, and remembers it. True if that changed it.
  bool limit(JointVector& tau) noexcept;

  Eigen::Index n_;
  double per_tip_velocity_;
  double power_;
  double ramp_share_;     ///< of the torque, in one tick
  double return_step_;    ///< of z
  double returning_ = 0;  ///< z
  bool known_ = false;
  bool ramping_ = false;
  bool anew_ = true;
  bool fading_ = false;
  double fade_ticks_ = 0;  ///< for how many more, 0 before the first
  JointVector last_;
  JointVector asked_;
  alignas(64) std::array<Bounds, kMaxJoints> joints_;
};

}  // namespace dashpot::controller
