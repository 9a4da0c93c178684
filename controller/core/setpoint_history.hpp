#pragma once
#include <dashpot/controller/core/sensed.hpp>
#include <dashpot/controller/law/gain_blend.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/tick_status.hpp>

#include <cmath>
#include <limits>
#include <optional>

namespace dashpot::controller {

/// The user's command: the last good set-point with its age, and gains, wrench and attachment on
/// their way to the commanded values.
class SetpointHistory {
 public:
  SetpointHistory(const RobotModel& model, const Settings& settings);
  /// The set-point is Settings::initial again; gains, and what is attached, stay.
  void reset() noexcept;
  /// Makes springs that start next stay where the robot is, with the current gains.
  void release() noexcept;

  /// Increases the age of the set-point, whatever the clock does after it was accepted.
  void age(double dt) noexcept { age_ += nanoseconds(dt); }
  /// Makes it lost at once.
  void give_up() noexcept { age_ = std::numeric_limits<double>::infinity(); }
  /// Returns whether it is fresh: kOk, kSetpointStale or kSetpointLost.
  Status age_status() const noexcept;

  /// What a set-point brings.
  enum class News : std::uint8_t {
    kRefused,  ///< it is invalid; the last good one stays
    kNone,     ///< it was checked before
    kGoal,
    kGains,  ///< and a goal
  };
  /// Takes over a set-point that is new and valid at the time `now`, ns.
  News take(const Setpoint& setpoint, std::int64_t now) noexcept;
  /// Starts gains and wrench at zero. Without a user's set-point, the goal is where the robot is.
  void restart(const Sensed& now) noexcept;
  /// Moves gains and wrench on by one period; in `hold` the wrench goes to zero.
  void step(bool hold) noexcept;

  /// Attaches something else to the arm. Springs keep their extension if T changes.
  void attach(const Attachment& attachment) noexcept;
  /// Moves what is attached on by one period.
  void step_attachment() noexcept { attachment_.step(); }

  const Setpoint& setpoint() const noexcept { return accepted_; }
  /// Returns where the set-point wants T, as far as T is on its way to its new place.
  Pose tip_goal() const noexcept {
    if (attachment_.still()) return accepted_.tip_pose;
    return carried(accepted_.tip_pose, attachment_.target().tool, attachment_.now().tool);
  }
  const GainBlend& gains() const noexcept { return gains_; }
  const Vector6& wrench() const noexcept { return wrench_.now(); }
  const Ramp<Attachment>& attachment() const noexcept { return attachment_; }
  /// Returns how often gains and attachment have changed, and how many steps are left of that.
  std::uint64_t changes() const noexcept { return gains_.changes() + attachment_.changes(); }
  double steps_left() const noexcept {
    return std::max(gains_.steps_left(), attachment_.steps_left());
  }

 private:
  struct Look {
    std::int64_t time;
    bool in_order;
  };
  /// Whole ns, which add up without rounding errors.
  static double nanoseconds(double seconds) noexcept { return std::round(1e9 * seconds); }

  const int n_;
  const Settings settings_;
  Setpoint accepted_;
  bool from_user_ = false;    ///< false: it is Settings::initial, where the robot started
  std::optional<Look> look_;  ///< at the last set-point; none yet
  double age_ = 0;            ///< ns
  GainBlend gains_;
  Ramp<Attachment> attachment_;
  Ramp<Vector6> wrench_;
};

}  // namespace dashpot::controller
