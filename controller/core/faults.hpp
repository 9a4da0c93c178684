#pragma once
#include <dashpot/controller/core/sensed.hpp>
#include <dashpot/controller/safety/motion_watch.hpp>
#include <dashpot/controller/safety/safety_filter.hpp>

namespace dashpot::controller {

/// Latches conditions with which the arm must not continue, and releases them. The first one stays
/// the fault until the brake is doubted.
class Faults {
 public:
  using Aim = SafetyFilter::Aim;

  Faults(const RobotModel& model, const Settings& settings)
      : motion_watch_(model, settings), settings_(settings) {}
  void reset() noexcept;
  void release() noexcept {
    fault_ = Status::kOk;
    rest_ = 0;
  }

  /// Checks a tick with a good state: `seen` is the status of its check. `still`: the references
  /// are at rest; `brake`: null unless it acts alone; it becomes softer if it shakes the arm.
  /// Returns kOk if the state allows springs, or kFaultLatched or worse.
  Status watch(Status seen, const Sensed& now, bool still, Brake* brake) noexcept;
  /// Records the torque of a tick, and its status. Lost states latch a fault after too long, also
  /// if there has been no good state for a time `lost` that is too long, s.
  void applied(Status status, const Sensed& now, double lost, const JointVector& torque) noexcept;
  /// Counts a restart of the springs, other than the first.
  void count_restart() noexcept { ++restarts_; }

  /// Returns the fault that latched, or kOk.
  Status fault() const noexcept { return fault_; }
  /// Returns what the arm is to do without springs.
  Aim aim() const noexcept;
  /// Returns for how long no state or law could be trusted, up to the last tick, s.
  double blind() const noexcept { return blind_ticks_ * settings_.period; }
  double tip_speed() const noexcept { return motion_watch_.tip_speed(); }
  void limit_tip_speed(double limit) noexcept { motion_watch_.limit_tip_speed(limit); }

 private:
  void latch(Status fault) noexcept;
  /// True once the robot has been at rest for Watchdog::release_after.
  bool rested(const Sensed& now) noexcept;
  /// True if the brake acts alone, and does not stop the arm.
  bool brake_fails(Status found, Brake* brake) noexcept;

  MotionWatch motion_watch_;
  const Settings settings_;
  Status fault_ = Status::kOk;
  double rest_ = 0;      ///< for how long the robot has been at rest, s
  double restarts_ = 0;  ///< of the last second or so
  int blind_ticks_ = 0;
};

}  // namespace dashpot::controller
