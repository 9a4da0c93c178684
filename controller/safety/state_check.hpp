#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <array>

namespace dashpot::controller {

/// Separates states that a robot can have from reports of a broken sensor, link or clock.
///
/// A state is compared with the last good one, t seconds older. A position may differ by
///
///     2 velocity_i t + 0.001 rad,
///
/// velocity_i being the limit of the settings or the robot's own, whichever is higher; or by the
/// motion of the measured velocities, the mean of the two times t, give or take half of the larger
/// one times t and 0.001 rad: a robot above its velocity limit does not have a broken sensor. A
/// velocity may differ by velocity_i (1/2 + 10/s t), or by any amount with which the position
/// agrees: at least a third of the way from the old velocity's position to the new one's. This
/// tolerates a blow.
///
/// States that agree with each other in this way for 20 ms (or longest_gap, if that is longer) are
/// followed, even if they do not agree with the last good one; others at the latest when t has
/// grown enough. By then a fault has latched (see Status), because the jump took longer than
/// longest_gap.
///
/// A time stamp that is not after the last one, or by less than a tenth of a period, is ignored: it
/// counts as a period, and the next stamp counts as much less.
///
/// Good states are compared with each other over about Watchdog::feedback: the change of the
/// positions with the velocities, and the time stamps with the period. See kStateContradictory and
/// kWrongRate.
///
/// A continuous joint may report its angle modulo 2 pi: `position` follows it without jumps. For
/// any other joint a wrap is a jump.
class StateCheck {
 public:
  StateCheck(const RobotModel& model, const Settings& settings);

  /// Returns kOk; kTimeGap, kWrongRate, kStateContradictory or kTimeBackward, whose states are
  /// good; or a status whose safe output is "ramp". Times are compared with the last state's, good
  /// or not.
  Status check(const RobotState& state) noexcept;
  /// Returns the last good position, n, rad.
  const JointVector& position() const noexcept { return good_.position; }
  /// Returns the last good velocity, n, rad/s: the measured one, or, from a contradiction on until
  /// `trust_velocities`, the rate of change of the positions, smoothed over three ticks.
  const JointVector& velocity() const noexcept { return blind_ ? velocity_ : good_.velocity; }
  /// Returns the time from the good state before the last state to the last state, s.
  double age() const noexcept { return age_; }
  /// Returns for how long time stamps have not gone forward, s.
  double backward() const noexcept { return backward_; }
  /// Uses measured velocities again, after a contradiction.
  void trust_velocities() noexcept { blind_ = false; }
  /// Makes the next state count as the first.
  void reset() noexcept;

 private:
  /// A finite state to compare with.
  struct Last {
    bool any = false;
    double age = 0;  ///< s
    JointVector position;
    JointVector velocity;
  };

  /// Returns the time that counts as passed if time stamps differ by `gap`, s.
  double counted(double gap) noexcept;
  bool follows(const Last& last, const RobotState& state) const noexcept;
  /// True if this state and those before have agreed with each other for long enough.
  bool believed(const RobotState& state, double gap) noexcept;
  /// True if ticks have come at another rate than the configured one.
  bool wrong_rate(double gap) noexcept;
  /// Compares a good state with the one before. Returns kOk, kStateContradictory or kWrongRate.
  Status compare(const JointVector& position, const JointVector& velocity, double gap) noexcept;
  /// True if positions have lately contradicted the velocities.
  bool contradictory(const JointVector& position, const JointVector& velocity) noexcept;
  void forget_motion() noexcept;

  Eigen::Index n_;
  double period_;
  double longest_gap_;
  double memory_;  ///< of `contradictory`, s; 0: none
  JointVector velocity_limit_;
  JointVector tolerance_;  ///< of `contradictory`, rad (m)
  std::array<bool, kMaxJoints> continuous_{};
  bool any_continuous_ = false;

  bool timed_ = false;  ///< last_time_ is known
  std::int64_t last_time_ = 0;
  double age_ = 0;
  double backward_ = 0;
  double ahead_ = 0;  ///< counted time less the time of the stamps, s
  Last good_;
  Last doubtful_;         ///< since the last good one
  double agreement_ = 0;  ///< time for which the doubtful ones have agreed, s

  JointVector velocity_;     ///< from positions, while blind_
  bool blind_ = false;       ///< the measured velocities contradicted the positions
  int intervals_ = 0;        ///< between ticks that `wrong_rate` has seen, at most kIntervals
  double excess_ = 0;        ///< mean of interval / period - 1
  JointVector unexplained_;  ///< recent motion not explained by the velocities, rad
  JointVector travelled_;    ///< the larger of both recent motions, rad
};

/// Returns seconds from `earlier` to `later`, in ns each, of any size.
inline double seconds_between(std::int64_t earlier, std::int64_t later) noexcept {
  std::int64_t difference = 0;
  if (__builtin_sub_overflow(later, earlier, &difference)) return later > earlier ? 1e10 : -1e10;
  return 1e-9 * static_cast<double>(difference);
}

}  // namespace dashpot::controller
