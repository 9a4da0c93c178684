#pragma once
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/status.hpp>

#include <array>

namespace dashpot::controller {

/// Tells states that a robot can be in from those that only a broken sensor, link or clock reports.
///
/// A state is compared with the last good one, t seconds older: no position may differ by more than
/// 2 velocity_i t + 0.001 rad, no velocity by more than velocity_i (1/2 + 10/s t), where velocity
/// is the limit. Both bounds grow with t, so that a state that really is elsewhere is believed
/// after a while.
///
/// A continuous joint may report its angle modulo 2 pi: `position` follows it without jumps.
class StateCheck {
 public:
  StateCheck(const RobotModel& model, const Settings& settings);

  /// kOk, kTimeGap, or a status whose safe output is "ramp". Times are compared with the last
  /// state's, good or not.
  Status check(const RobotState& state) noexcept;
  /// Of the last good state, n, rad.
  const JointVector& position() const noexcept { return position_; }
  /// The next state is like the first.
  void reset() noexcept;

 private:
  bool jumped(const RobotState& state) noexcept;
  /// Angles of continuous joints nearest to their last.
  void unwrap(JointVector& position) const noexcept;

  Eigen::Index n_;
  double period_;
  double longest_gap_;
  JointVector velocity_limit_;
  std::array<bool, kMaxJoints> continuous_{};
  bool any_continuous_ = false;

  bool timed_ = false;    ///< last_time_ is known
  bool started_ = false;  ///< there was a good state
  std::int64_t last_time_ = 0;
  double age_ = 0;  ///< of the last good state, s
  JointVector position_;
  JointVector velocity_;
};

/// Seconds from `earlier` to `later`, in ns each, of any size.
inline double seconds_between(std::int64_t earlier, std::int64_t later) noexcept {
  std::int64_t difference = 0;
  if (__builtin_sub_overflow(later, earlier, &difference)) return later > earlier ? 1e10 : -1e10;
  return 1e-9 * static_cast<double>(difference);
}

}  // namespace dashpot::controller
