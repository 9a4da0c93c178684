#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/controller/robot_types.hpp>

#include <memory>
#include <string>

namespace dashpot::apps {

/// Computes a torque from a measurement, in the terms of plugin.h. The loop's thread calls the
/// noexcept functions, which do not allocate or wait. Another thread, one at a time, calls the
/// others, which may take milliseconds; without real time it may be the same thread.
class LoopController {
 public:
  LoopController() = default;
  LoopController(const LoopController&) = delete;
  LoopController& operator=(const LoopController&) = delete;
  virtual ~LoopController() = default;

  /// A tick: the torque for this measurement, and a status. `time` in ns; n entries each.
  /// `setpoint` is the goal, and is new if its time is; its gains do not count. Null: no new one.
  /// A pose refers to the T that an earlier tick has taken up.
  virtual std::int32_t update(std::int64_t time, const JointVector& q, const JointVector& qd,
                              const controller::Setpoint* setpoint,
                              JointVector& torque) noexcept = 0;
  /// Stops the arm: the set-point is dropped until a new one comes.
  virtual void stop() noexcept = 0;
  /// Whether a status of update() asks the host to engage the robot's own brakes.
  virtual bool needs_brakes() const noexcept = 0;
  /// Returns the snapshot of the last tick.
  virtual const dashpot_snapshot& snapshot() noexcept = 0;
  /// Returns modes if they are newer than the modes returned last; otherwise null.
  virtual const dashpot_modes* new_modes() noexcept = 0;
  /// Does the same for the sampled loop.
  virtual const dashpot_sampled_modes* new_sampled_modes() noexcept { return nullptr; }

  /// Before the loop begins, with the robot at rest at q. Returns DASHPOT_OK, or the code of a
  /// refusal; `reason` then says why, in one line.
  virtual std::int32_t start(const JointVector& q, std::string& reason) = 0;
  /// The springs and dampers from the next tick on. Returns as start(); with DASHPOT_OK `reason`
  /// holds the warnings, if any.
  virtual std::int32_t set_gains(const controller::Gains& gains, std::string& reason) = 0;
  /// Sets the payload from the next tick on, T in the tip link, and the gains for it, if there are
  /// new ones. Returns as set_gains().
  virtual std::int32_t set_payload(const controller::Payload& payload, const controller::Pose& tool,
                                   const controller::Gains* gains, std::string& reason) = 0;
  /// Limits the speed of the tip from the next tick on. Returns as start().
  virtual std::int32_t limit_tip_speed(const controller::TipSpeed& speed, std::string& reason) = 0;
  /// Whether the controller would accept this set-point, with its gains, from q; for a controller
  /// outside a loop. Returns as start().
  virtual std::int32_t check(const controller::Setpoint& setpoint, const JointVector& q,
                             std::string& reason) = 0;
  /// Releases a latched fault at the next tick: the robot is held where it is, until there is a new
  /// set-point.
  virtual std::int32_t release() = 0;
};

/// The controller plugin, loaded at run time as any host would.
class PluginLibrary {
 public:
  /// Empty: libdashpot_plugin.so beside the program, where it is installed, or where the system
  /// looks for libraries. Throws InputError.
  explicit PluginLibrary(const std::string& path);

  /// A controller for the file. Throws InputError with the plugin's own words.
  std::unique_ptr<LoopController> create(const std::string& config_path, int joints) const;
  const dashpot_plugin& functions() const noexcept { return *functions_; }

 private:
  const dashpot_plugin* functions_ = nullptr;  // for the rest of the program
};

}  // namespace dashpot::apps
