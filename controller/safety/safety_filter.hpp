#pragma once
#include <dashpot/controller/safety/brake.hpp>

#include <array>

namespace dashpot::controller {

/// The last check of every torque. With w the weight (the gravity torque that the controller
/// compensates, n) the torque is
///     tau = w + b + x,       x = f(law's torque - w),
/// b being the brake while no springs act (see Brake::stop), and keeps
///     |tau_i| <= torque_i   and   |tau_i - last tau_i| <= torque_rate_i T.
///
/// f, in this order, while springs act:
/// - x shrinks evenly by (0.9 - v) / 0.25 where it adds energy (x' qd > 0) to a robot whose tip
///   moves with the share v > 0.65 of its limit, and to the power Limits::power.
/// - Springs and all other torques but dampers shrink evenly, in all joints alike, to 0.8 of the
///   torque
/// that the weight leaves: the wrench at the tip keeps its direction. Dampers shrink evenly to all
/// of it, and the sum is clipped. So an arm that presses too hard stays damped: without this
/// reserve the torque of a joint at its limit would not change with its velocity.
/// - Brake::hold takes away torque that would move a joint out of its interval of allowed velocity.
///
/// When springs end or start again, x goes evenly from the acting to the requested torque: by the
/// same share of the way in all joints, the largest with which no joint's rate limit acts on it.
/// Otherwise joints with little torque would let go first, and turn the wrench that the tip exerts.
/// It takes as many ticks as the joint with the longest way needed at first. The brake does not
/// wait for it, nor does torque against the motion of a joint while no springs act.
class SafetyFilter {
 public:
  /// What the arm is to do.
  enum class Aim : std::uint8_t {
    kSprings,  ///< the torque of the law
    kStop,     ///< stop
    kReturn,   ///< stop, but joints outside their position limits come back
    kBlind,    ///< stop, with the motion predicted by the model
    kFloat,    ///< nothing: the weight alone
  };

  /// `gears`: see Brake.
  explicit SafetyFilter(const Settings& settings, double gears = 0) noexcept;

  /// Forgets the past. The next torque continues the last one.
  void restart() noexcept;
  /// Forgets the past; `torque` is what acts now.
  void reset(const JointVector& torque) noexcept;
  /// Starts from the weight while the acting torque is unknown.
  void assume(const JointVector& weight) noexcept {
    if (!known_) reset(weight);
  }
  /// Makes the next torque fade evenly from the last one instead of continuing it.
  void begin_anew() noexcept { anew_ = true; }

  /// Sets the limit of the tip's speed, m/s, above zero.
  void limit_tip_speed(double limit) noexcept { per_tip_velocity_ = 1 / limit; }

  /// Makes the law's torque safe, in place; `dampers` is the part of it that damps, `tip_speed` in
  /// m/s. Returns kOk, kTorqueLimited, kNearJointLimit, kWeightNotHeld, or kNotFinite, and then
  /// stops, or sets what `ramp` gives if the weight is not finite either.
  Status apply(const Brake::Motion& motion, double tip_speed, Aim aim, const JointVector& dampers,
               JointVector& tau) noexcept;

  /// Sets the last torque again.
  void repeat(JointVector& tau) noexcept {
    known_ = true;  // its output is the acting torque
    tau = last_;
  }
  /// Takes the last torque evenly to zero within 0.1 s, or as fast as the rate limits allow.
  void ramp(JointVector& tau) noexcept;

  /// Returns the input of the last `apply`, before the limits.
  const JointVector& asked() const noexcept { return asked_; }
  /// Returns the output of the last `apply` or `ramp`.
  const JointVector& last() const noexcept { return last_; }
  /// True during the fade after springs ended or started.
  bool fades() const noexcept { return anew_ || fading_; }
  Brake& brake() noexcept { return brake_; }

 private:
  /// What is known of a joint.
  struct Bounds {
    double torque;         ///< limit, N m
    double torque_step;    ///< limit of its change in one tick, N m
    double per_velocity;   ///< 1 / velocity, s/rad
    double acting = 0;     ///< x of the last torque, while it fades, N m
    double ramp_step = 0;  ///< N m
  };

  Bounds& joint(Eigen::Index i) noexcept { return joints_[static_cast<std::size_t>(i)]; }
  const Bounds& joint(Eigen::Index i) const noexcept {
    return joints_[static_cast<std::size_t>(i)];
  }
  /// Scales torque that drives a robot whose tip is fast, or gives too much power. True if it did.
  bool hold_back(const JointVector& qd, double tip_speed, JointVector& excess) const noexcept;
  /// Fits `excess` into the torque limits beside `base`, dampers first. True if it was too large.
  bool share_out(const JointVector& base, const JointVector& dampers,
                 JointVector& excess) const noexcept;
  /// Returns the share of `part` for which there is room beside `base`, at most 1.
  double fitting(const JointVector& base, const JointVector& part, double most) const noexcept;
  /// Splits the last torque into `weight`, the acting part of the brake in `base`, and the part
  /// that fades.
  void take_over(const JointVector& base, const JointVector& weight) noexcept;
  /// Moves from the acting excess toward `excess`, within the torque limits beyond `base`, and
  /// returns it there. True if the fade is not at its end.
  bool fade(const JointVector& qd, bool springs, const JointVector& base,
            JointVector& excess) noexcept;
  /// Bounds the finite `tau` and its change, and remembers it. True if that changed it.
  bool limit(JointVector& tau) noexcept;

  Eigen::Index n_;
  Brake brake_;
  double per_tip_velocity_;
  double power_;
  double ramp_share_;  ///< of the torque, in one tick
  double return_step_;
  double longest_fade_;   ///< ticks
  double stopping_ = 0;   ///< number of ticks without springs
  double returning_ = 0;  ///< share of the return velocity
  bool known_ = false;
  bool ramping_ = false;
  bool anew_ = true;
  bool fading_ = false;
  double fade_ticks_ = 0;  ///< remaining ticks, 0 before the first
  JointVector last_;
  JointVector asked_;
  alignas(64) std::array<Bounds, kMaxJoints> joints_;
};

}  // namespace dashpot::controller
