#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/controller/snapshot.hpp>

#include <memory>

namespace dashpot::controller {

class ControllerCore;

/// Impedance controller for one arm: from measured state and set-point to joint torque, once a
/// tick.
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
/// Read in this order: robot_model.hpp, dynamics.hpp, motion/setpoint_path.hpp, law/gain_path.hpp,
/// law/held_damping.hpp, law/impedance_law.hpp, safety/safety_filter.hpp, vibration/vibration.hpp,
/// and core/fixed_core.hpp, which calls them.
///
/// One thread at a time may use a Controller; `Latest` (latest.hpp) hands set-points to the thread
/// of `update` and snapshots from it.
class Controller {
 public:
  /// Throws InvalidSettings with key, value and unit. The model is copied.
  Controller(const RobotModel& model, const Settings& settings);
  ~Controller();
  Controller(Controller&&) noexcept;
  Controller& operator=(Controller&&) noexcept;
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// One tick: sets `torque` (n, N m) to what the robot is to apply until the next one; with every
  /// status it is safe to send (see Status). Bounded work; no allocation, lock, exception or system
  /// call.
  Status update(const RobotState& state, const Setpoint& setpoint, JointVector& torque) noexcept;
  /// The same without a set-point: the last one stays, or, before the first, the robot where it was
  /// found.
  Status update(const RobotState& state, JointVector& torque) noexcept;

  /// Of the last tick.
  const Snapshot& snapshot() const noexcept;
  /// Of the last tick that analysed, every Analysis::every of them.
  const Vibration& vibration() const noexcept;
  /// The latest that the analysis of the sampled loop (Analysis::Sampled) has found; null as long
  /// as there is nothing since the last reset. For one thread, always the same, which may be
  /// another than that of `update`; the result is good until its next call.
  const SampledVibration* sampled_vibration() noexcept;
  /// The closed loop at the last tick, linearised where its springs are at rest, in joint
  /// coordinates (vibration/closed_loop.hpp): mass, damping, stiffness and its factor. Not to be
  /// called before the first good state.
  void closed_loop(analysis::System<kMaxJoints>& system) const noexcept;

  /// Forgets everything, faults too: the next tick is like the first, and holds the robot where it
  /// is. The torque-rate limit counts from the last torque; if there was none yet, from the weight
  /// of the arm at that tick.
  void reset() noexcept;
  /// The same, but the torque-rate limit counts from `torque` (n, N m), which the robot applies
  /// now.
  void reset(const JointVector& torque) noexcept;
  /// Releases a latched fault (see Status): unless its cause is still there, the next tick's
  /// springs start where the robot is, with the gains in force, and hold it there until there is
  /// another set-point. Nothing happens without a fault.
  void release() noexcept;

  int joints() const noexcept;  ///< n
  const Settings& settings() const noexcept;

 private:
  std::unique_ptr<ControllerCore> core_;
};

}  // namespace dashpot::controller
