#pragma once
#include <dashpot/apps/loop/loop_controller.hpp>
#include <dashpot/apps/scene/scene.hpp>

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

namespace dashpot::apps {

/// The greatest values of a run, of the robot itself and not of its sensors.
struct Extremes {
  double speed_share = 0;     ///< of a joint's speed over its limit; 0 for a system of matrices
  double tip_speed = 0;       ///< m/s; likewise
  double kinetic_energy = 0;  ///< J
};

/// A scene in motion: a controller and the simulated mechanism, one period at a time:
///     ClosedLoop loop(scene, controller);
///     while (...) { loop.follow_scenario(); loop.control(); loop.move(); }
/// The same calls give the same bits. Only the constructor throws.
///
/// The constructor brings the robot to its start as a person would: a hand holds it at rest where
/// the springs are fixed until the controller's torque has settled, guides it slowly to where it is
/// to start, and lets go of it at time 0. What starts outside its position limits is held there
/// from the first tick on.
///
/// Gains are judged by the controller before it takes them, which may take milliseconds. In real
/// time that is for another thread to do than the loop's: see leave_gains().
class ClosedLoop {
 public:
  /// Both must outlive it. Throws InputError if the controller refuses the first set-point, or is
  /// not content with what the hand does.
  ClosedLoop(const Scene& scene, LoopController& controller);

  // The loop's thread:
  /// The user's part of a tick: takes the scenario's steps whose time has come.
  void follow_scenario() noexcept;
  /// The controller's part of a tick: reads the sensors and finds a torque. Returns a status, that
  /// of the last call in a period without one.
  std::int32_t control() noexcept;
  /// The robot's part: one period under that torque.
  sim::Status move() noexcept;
  /// Goes there from the next tick on; the scenario's steps to come still take their turn. The
  /// gains of `setpoint` do not count.
  void hold(const controller::Setpoint& setpoint) noexcept;
  /// What the controller was told to hold last.
  const controller::Setpoint& setpoint() const noexcept { return setpoint_; }
  /// After a tick: whether a fault is latched. Meanwhile nothing is held. Whoever releases it finds
  /// the robot held where it is until there is news; if the controller has let go of the fault by
  /// itself, what was held before goes on.
  void note_fault(bool latched) noexcept;

  // Other threads, which may have to wait for each other:
  /// Changes the gains in force; DASHPOT_OK, or the code of the controller's refusal, with its
  /// reason in one line.
  std::int32_t change_gains(const std::function<void(controller::Gains&)>& change,
                            std::string& reason);
  /// Releases a latched fault at the next tick.
  void release();
  /// From now on follow_scenario() leaves the gains of the scenario's steps to follow_gains().
  /// Before the loop begins.
  void leave_gains() noexcept { leave_gains_ = true; }
  /// Brings the gains of the scenario's steps whose time has come. Always the same thread.
  void follow_gains();
  /// Steps whose gains the controller has refused, and why the last of them.
  int refused_steps() const noexcept { return refused_steps_; }
  const std::string& refusal() const noexcept { return refusal_; }

  LoopController& controller() noexcept { return controller_; }
  const sim::Plant& plant() const noexcept { return *plant_; }
  const Extremes& extremes() const noexcept { return extremes_; }

 private:
  void begin();
  void guide(const JointVector& from, const JointVector& to, double duration, double settling);
  const LoopFault* loop_fault() const noexcept;
  void carry(const LoopFault& fault) noexcept;

  const Scene& scene_;
  LoopController& controller_;
  std::unique_ptr<sim::System> mechanism_;
  sim::Arm* arm_ = nullptr;  // the mechanism, if it is one
  std::optional<sim::Plant> plant_;
  bool leave_gains_ = false;

  // The loop's own:
  JointVector torque_;
  controller::Setpoint setpoint_;
  controller::Setpoint accepted_;  ///< the last that the controller did not reject
  bool in_force_ = true;           ///< of setpoint_
  bool news_ = true;               ///< setpoint_ is to be read again
  bool faulted_ = false;           ///< a fault was latched after the last tick
  std::size_t next_step_ = 0;
  std::int64_t repeat_every_ = 1;  // ticks
  std::int64_t ticks_ = 0;         // since the start
  std::int32_t status_ = DASHPOT_OK;
  const LoopFault* hand_ = nullptr;  // the fault in which a hand has taken the robot,
  JointVector taken_at_;             // and where
  Extremes extremes_;

  // Between the threads:
  std::atomic<std::size_t> due_steps_{0};      ///< steps whose time has come
  std::atomic<std::int64_t> gain_changes_{0};  ///< so far
  std::atomic<bool> released_{false};          ///< somebody asked for the release of the fault
  std::int64_t gain_changes_seen_ = 0;         ///< by the loop

  std::mutex mutex_;  ///< of what follows, and of the controller's functions for other threads
  controller::Gains gains_;

  // Of the thread that follows the scenario's gains:
  std::size_t followed_steps_ = 0;
  int refused_steps_ = 0;
  std::string refusal_;
};

}  // namespace dashpot::apps
