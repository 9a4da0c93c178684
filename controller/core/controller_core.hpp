#pragma once
#include <dashpot/controller/core/faults.hpp>
#include <dashpot/controller/core/loop_analysis.hpp>
#include <dashpot/controller/core/reference_generator.hpp>
#include <dashpot/controller/core/setpoint_history.hpp>
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/law/energy_tank.hpp>
#include <dashpot/controller/law/impedance_law.hpp>
#include <dashpot/controller/safety/state_check.hpp>

namespace dashpot::controller {

/// Implementation of Controller: `update` calls the stages of a tick one after the other and passes
/// their results on. No stage knows another.
class ControllerCore {
 public:
  /// The settings must be valid.
  ControllerCore(const RobotModel& model, const Settings& settings);

  /// `setpoint`: null if there is none; the last one stays then.
  Status update(const RobotState& state, const Setpoint* setpoint, JointVector& torque) noexcept;
  void reset(const JointVector& torque) noexcept;
  void release() noexcept;
  void stop() noexcept { setpoints_.give_up(); }
  void attach(const Attachment& attachment) noexcept { setpoints_.attach(attachment); }
  void limit_tip_speed(const TipSpeed& speed) noexcept;
  void closed_loop(analysis::System<kMaxJoints>& system) const noexcept {
    analysis_.closed_loop(loop(), system);
  }

  const Snapshot& snapshot() const noexcept { return snapshot_; }
  const Vibration& vibration() const noexcept { return analysis_.result(); }
  SampledAnalysis* sampled() noexcept { return analysis_.sampled(); }
  const Settings& settings() const noexcept { return settings_; }

 private:
  using Aim = SafetyFilter::Aim;

  /// Starts the springs where the robot is, with gains that grow from zero.
  void restart_springs() noexcept;
  /// Acts while the state has not been trusted for a time `lost`, s: the last torque, then the
  /// brake for the predicted motion with the last known weight, and at last a ramp.
  void go_blind(double lost, JointVector& torque) noexcept;
  /// Ends the action of the springs.
  void brake() noexcept;
  /// Makes the springs restart when they act next.
  void forget_springs() noexcept;
  /// Copies the tick to the snapshot.
  void show() noexcept;
  Status finish(Status status, const JointVector& torque) noexcept;

  /// True if springs gave the last torque and may continue.
  bool in_force() const noexcept { return aim_ == Aim::kSprings && faults_.fault() == Status::kOk; }
  LoopAnalysis::Loop loop() const noexcept;

  const int n_;
  const Settings settings_;

  // The stages, in the order of a tick:
  StateCheck state_check_;
  DynamicsKernel kernel_;
  SetpointHistory setpoints_;
  Faults faults_;
  DesignedDamping designed_;
  ReferenceGenerator generator_;
  ImpedanceLaw law_;
  SpringIntegral integral_;
  EnergyTank tank_;
  SafetyFilter filter_;
  LoopAnalysis analysis_;
  const JointVector viscous_friction_;  ///< of the robot, N m s/rad
  const JointVector friction_left_;     ///< after compensation; may be negative

  // What the last tick left:
  Sensed sensed_;
  Aim aim_ = Aim::kStop;
  bool short_ = false;  ///< the energy tank weakened the law
  bool given_ = false;  ///< the torque at the start is known
  LawTorque asked_;
  analysis::DampingLevel level_;  ///< of the ratios
  Impedance brake_;               ///< damping of the brake that acts where no springs do
  std::uint64_t integrated_ = 0;  ///< changes of set-points that the integral has seen
  Snapshot snapshot_;
};

}  // namespace dashpot::controller
