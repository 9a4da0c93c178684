#pragma once
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/lcmtypes/driver.hpp>

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

namespace dashpot::apps {

/// A simulated arm behind a driver's messages. It behaves like the public drivers under torque
/// commands: their filters, their torque without commands, the commands that end them. A command
/// acts a period after its status, or later by the scene's `delay`.
///
/// iiwa (`--torque_only`): without a command for 0.05 s, and before the first, the driver's PD
/// controller holds the position of that moment; torques count again with the next command, without
/// blending. Velocities are differences through a low-pass of 40 Hz. utime is -1 for the first 200
/// statuses. It ends at a command within 0.25 s of the first status, and at arrays of another
/// length.
///
/// With `environment.joint_stiffness` or `joint_damping` in its scene, the iiwa is in KUKA's mode
/// Torque: these springs pull to the position commanded a period before, at first where it is.
///
/// Panda (`--control_mode torque`): a command whose utime is more than 0.1 s in the past or the
/// future does not count; without one that counts, joints are damped. Torques pass libfranka's
/// low-pass of 30 Hz and rate limit of 1000 N m/s. It ends at anything but seven torques, no
/// positions, and control mode 4.
///
/// The driver compensates gravity, so the scene's robot has none.
class FakeDriver {
 public:
  /// `scene` has to outlive it. Throws InputError.
  FakeDriver(const Scene& scene, lcmtypes::DriverKind kind);

  double period() const noexcept { return scene_.plant.period; }
  /// Takes a command that arrived at `utime` of the driver's clock, us.
  /// Throws std::runtime_error with the reason if the command ends the driver.
  void take(const void* data, std::size_t size, std::int64_t utime);
  /// Moves the robot by one period, which ends at `utime`.
  void step(std::int64_t utime);
  /// Returns the present status.
  lcmtypes::DriverStatus status(std::int64_t utime) const;

  double time() const noexcept { return plant_->time(); }
  std::int64_t statuses() const noexcept { return statuses_; }
  std::int64_t commands() const noexcept { return commands_; }
  /// Periods in which no command counted.
  std::int64_t uncommanded() const noexcept { return uncommanded_; }

 private:
  /// Returns the torque of this period: a command acts `delay` periods after the status that it
  /// answers.
  JointVector torque(std::int64_t utime);
  JointVector torque_of_iiwa(bool counts) const;
  /// Returns the torque behind the Panda's low-pass and rate limit.
  JointVector filtered(const JointVector& torque);
  /// Returns the torque of a driver without commands: it holds, or damps.
  JointVector resting_torque();
  bool has_springs() const noexcept;

  const Scene& scene_;
  lcmtypes::DriverKind kind_;
  std::optional<sim::Arm> arm_;
  std::optional<sim::Plant> plant_;
  std::optional<lcmtypes::DriverCommand> command_;
  std::int64_t arrived_ = 0;              ///< when the command did, us
  std::int64_t first_ = 0;                ///< utime of the first status
  std::optional<JointVector> held_;       ///< the position that the PD holds
  JointVector spring_rest_;               ///< where KUKA's springs are fixed
  std::deque<JointVector> due_;           ///< torques that will act
  JointVector last_torque_;               ///< of the Panda's low-pass
  JointVector last_position_, velocity_;  ///< through the iiwa's low-pass
  std::int64_t statuses_ = 0, commands_ = 0, uncommanded_ = 0;
};

}  // namespace dashpot::apps
