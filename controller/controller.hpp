#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/controller/snapshot.hpp>

#include <memory>

namespace dashpot::controller {

class ControllerCore;

/// Impedance controller for one arm. Once a tick it computes the joint torque from the measured
/// state and the set-point.
///
///     const auto model = RobotModel::from_urdf_file("panda.urdf", "panda_link0", "panda_hand");
///     Controller controller(model, default_settings(model));
///     JointVector torque;
///     for (;;) {                                 // every Settings::period
///       ...                                      // read `state`
///       const Status status = controller.update(state, setpoint, torque);
///       ...                                      // send `torque`, whatever the status
///     }
///
/// Read core/controller_core.cpp first, whose `update` calls the stages of a tick one after the
/// other, and then the stages in this order.
///
/// One thread at a time may use a Controller, also its const functions; `Latest` (latest.hpp)
/// hands set-points to the thread of `update` and snapshots from it.
class Controller {
 public:
  /// Copies the model. Throws InvalidSettings with key, value and unit.
  Controller(const RobotModel& model, const Settings& settings);
  ~Controller();
  Controller(Controller&&) noexcept;
  Controller& operator=(Controller&&) noexcept;
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// Does one tick: sets `torque` (n, N m) to the torque that the robot is to apply until the next
  /// tick. The torque is safe to send with every status (see Status). The work is bounded, without
  /// allocation, lock, exception or system call.
  Status update(const RobotState& state, const Setpoint& setpoint, JointVector& torque) noexcept;
  /// Does one tick without a set-point: the last one stays, or, before the first, the
  /// springs where the robot was found. It grows old as any other (Watchdog::setpoint_hold, ...).
  Status update(const RobotState& state, JointVector& torque) noexcept;

  /// Returns what the last tick measured and put out.
  const Snapshot& snapshot() const noexcept;
  /// Returns the modes of the last tick that was analysed; one in Analysis::every ticks is.
  const Vibration& vibration() const noexcept;
  /// Returns the latest result of the analysis of the sampled loop (Analysis::Sampled); null as
  /// long as there is none since the last reset. One thread, always the same, may call this; it may
  /// be another thread than the one that calls `update`. The result is valid until the next call.
  const SampledVibration* sampled_vibration() noexcept;
  /// Sets `system` to the closed loop at the last tick, linearised where its springs are at rest:
  /// mass, damping, stiffness and its factor, in joint coordinates (vibration/closed_loop.hpp) or
  /// in the coordinates of analysis::Gears. Must not be called before the first good state.
  void closed_loop(analysis::System<kMaxJoints>& system) const noexcept;

  /// Forgets everything, faults as well: the next tick is like the first, and keeps the robot where
  /// it is. The torque-rate limit counts from the last torque, or, if there was none yet, from the
  /// weight of the arm at the next tick.
  void reset() noexcept;
  /// Resets likewise, but the torque-rate limit counts from `torque` (n, N m), the torque that the
  /// robot applies now.
  void reset(const JointVector& torque) noexcept;
  /// Releases a latched fault (see Status), unless the cause of the fault is still present. From
  /// the next tick on the springs start where the robot is, with the current gains, and keep it
  /// there until there is another set-point. Does nothing if there is no fault.
  void release() noexcept;

  /// Gives up the set-point, as a host that ends: from the next tick on it counts as lost
  /// (kSetpointLost), until there is a new one or a reset.
  void stop() noexcept;

  /// Changes what is attached to the tip link within Motion::gain_time: from the next tick on the
  /// weight, M and all that follows from them go evenly to their new values. If the tool's frame T
  /// changes, springs keep their extension: reference and goal stay where they are on the tip link.
  /// A pose of the tip in a later set-point is one of the new T, also while T is on its way. Faults
  /// and resets keep the attachment; a reset ends its change at once.
  void attach(const Attachment& attachment) noexcept;
  /// Sets limits of the tip's speed from the next tick on; lower limits of the settings still hold.
  /// With a lower TipSpeed::limit the reference moves the tip with at most 0.6 of it. In mode
  /// kJoint the reference keeps to these limits at the robot's posture, and without them to
  /// Motion::velocity alone. A tip that is faster at that moment is a fault. Resets keep them.
  void limit_tip_speed(const TipSpeed& speed) noexcept;

  int joints() const noexcept;  ///< n
  const Settings& settings() const noexcept;

 private:
  std::unique_ptr<ControllerCore> core_;
};

}  // namespace dashpot::controller
