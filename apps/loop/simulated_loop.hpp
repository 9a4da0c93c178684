#pragma once
#include <dashpot/apps/loop/loop_goal.hpp>
#include <dashpot/apps/scene/scene.hpp>

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

namespace dashpot::apps {

/// The greatest true values of a run, not the sensors'.
struct Extremes {
  double speed_share = 0;     ///< of a joint's speed over its limit
  double tip_speed = 0;       ///< m/s
  double kinetic_energy = 0;  ///< J
  double contact_force = 0;   ///< of the wall, N; 0 without one
};

/// A scene in motion: a controller and the simulated arm, one period at a time:
///     ClosedLoop loop(scene, controller);
///     while (...) { loop.follow_scenario(); loop.control(); loop.move(); }
/// Equal calls give equal bits. Only the constructor throws.
///
/// The constructor brings the robot to its start as a person would: a hand holds it at rest where
/// the springs are fixed until the controller's torque has settled, guides it slowly to its start,
/// and releases it at time 0. A robot that starts outside its position limits is held at its start
/// from the first tick on.
///
/// The controller judges gains before it takes them, which may take milliseconds. In real time
/// another thread than the loop's must do this: see leave_gains().
class ClosedLoop {
 public:
  /// Both must outlive it. Throws InputError if the controller refuses the first set-point, or
  /// rejects it or latches a fault during the guidance.
  ClosedLoop(const Scene& scene, LoopController& controller);

  // The loop's thread:
  /// The user's part of a tick: takes the scenario's steps whose time has come.
  void follow_scenario() noexcept;
  /// The controller's part of a tick: reads the sensors and computes a torque. Returns the status
  /// of the call, or of the last one in a period without a call.
  std::int32_t control() noexcept;
  /// The robot's part: one period under that torque.
  sim::Status move() noexcept;
  /// Returns the goal by the scenario or by a command.
  LoopGoal& goal() noexcept { return goal_; }

  // Another thread:
  /// From now on follow_scenario() leaves the gains of the scenario's steps to follow_gains().
  /// Before the loop begins.
  void leave_gains() noexcept { leave_gains_ = true; }
  /// Sets the gains of the scenario's steps whose time has come. Always the same thread.
  void follow_gains();
  /// Steps whose gains the controller has refused, and why the last of them.
  int refused_steps() const noexcept { return refused_steps_; }
  const std::string& refusal() const noexcept { return refusal_; }

  LoopController& controller() noexcept { return controller_; }
  const sim::Plant& plant() const noexcept { return *plant_; }
  /// Returns the force of the wall on the tip now, N, in the base's axes; nothing without a wall.
  std::optional<Eigen::Vector3d> contact_force() noexcept;
  const Extremes& extremes() const noexcept { return extremes_; }

 private:
  void begin();
  void guide(const JointVector& from, const JointVector& to, double duration, double settling);
  const LoopFault* loop_fault() const noexcept;
  void carry(const LoopFault& fault) noexcept;

  const Scene& scene_;
  LoopController& controller_;
  sim::Arm arm_;
  std::optional<sim::Plant> plant_;
  LoopGoal goal_;
  bool leave_gains_ = false;

  // The loop's own:
  JointVector torque_;
  std::size_t next_step_ = 0;
  std::int64_t ticks_ = 0;  // since the start
  std::int32_t status_ = DASHPOT_OK;
  const LoopFault* hand_ = nullptr;  // the fault in which a hand has taken the robot,
  JointVector taken_at_;             // and where
  Extremes extremes_;

  // Between the threads:
  std::atomic<std::size_t> due_steps_{0};  ///< steps whose time has come

  // For the thread that follows the scenario's gains:
  std::size_t followed_steps_ = 0;
  int refused_steps_ = 0;
  std::string refusal_;
};

}  // namespace dashpot::apps
