#pragma once
#include <dashpot/apps/loop_controller.hpp>
#include <dashpot/apps/scene.hpp>

#include <cstdint>
#include <optional>

namespace dashpot::apps {

/// The greatest values of a run, of the robot itself and not of its sensors.
struct Extremes {
  double speed_share = 0;     ///< of a joint's speed over its limit; 0 for a system of matrices
  double tip_speed = 0;       ///< m/s; likewise
  double kinetic_energy = 0;  ///< J
};

/// A scene in motion: a controller and the simulated mechanism, one period at a time:
///     ClosedLoop loop(scene, controller);
///     while (...) { loop.control(); loop.move(); }
/// The same calls give the same bits. Only the constructor allocates or throws.
///
/// The constructor brings the robot to its start as a person would: a hand holds it at rest where
/// the springs are fixed until the controller's torque has settled, guides it slowly to where it is
/// to start, and lets go of it at time 0. What starts outside its position limits is held there
/// from the first tick on.
class ClosedLoop {
 public:
  /// Both must outlive it. Throws InputError if the controller refuses the first set-point, or is
  /// not content with what the hand does.
  ClosedLoop(const Scene& scene, LoopController& controller);

  /// The controller's part of a tick: reads the sensors and finds a torque. Returns a status, that
  /// of the last call in a period without one.
  std::int32_t control() noexcept;
  /// The robot's part: one period under that torque.
  sim::Status move() noexcept;

  /// Holds this from the next tick on; the scenario's steps to come still take their turn.
  std::int32_t hold(const controller::Setpoint& setpoint) noexcept;
  /// What the controller was told to hold last.
  const controller::Setpoint& setpoint() const noexcept { return setpoint_; }

  LoopController& controller() noexcept { return controller_; }
  const sim::Plant& plant() const noexcept { return *plant_; }
  const Extremes& extremes() const noexcept { return extremes_; }

 private:
  void guide(const JointVector& from, const JointVector& to, double duration, double settling);
  void follow_scenario(std::int64_t tick) noexcept;
  const LoopFault* loop_fault() const noexcept;
  void carry(const LoopFault& fault) noexcept;

  const Scene& scene_;
  LoopController& controller_;
  std::unique_ptr<sim::System> mechanism_;
  sim::Arm* arm_ = nullptr;  // the mechanism, if it is one
  std::optional<sim::Plant> plant_;
  JointVector torque_;
  controller::Setpoint setpoint_;
  std::size_t next_step_ = 0;
  std::int64_t repeat_every_ = 1;  // ticks
  std::int64_t ticks_ = 0;         // since the start
  std::int64_t told_at_ = 0;       // the tick of the last set-point
  std::int32_t status_ = DASHPOT_OK;
  const LoopFault* hand_ = nullptr;  // the fault in which a hand has taken the robot,
  JointVector taken_at_;             // and where
  Extremes extremes_;
};

}  // namespace dashpot::apps
