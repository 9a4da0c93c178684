#pragma once
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/law/impedance_law.hpp>
#include <dashpot/controller/safety/brake_doubt.hpp>
#include <dashpot/controller/safety/motion_watch.hpp>
#include <dashpot/controller/safety/safety_filter.hpp>
#include <dashpot/controller/safety/state_check.hpp>
#include <dashpot/controller/vibration/loop_system.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>
#include <dashpot/controller/vibration/vibration.hpp>

#include <memory>
#include <optional>

namespace dashpot::controller {

/// Implementation of Controller. One tick, in `update`:
///     state -> StateCheck -> DynamicsKernel -> MotionWatch -> set-point, references, gains
///           -> DesignedDamping -> ImpedanceLaw -> SafetyFilter -> torque;   and with these gains
///           -> LoopSystem -> VibrationAnalysis
class ControllerCore {
 public:
  /// The settings must be valid.
  ControllerCore(const RobotModel& model, const Settings& settings);

  /// `setpoint`: null if there is none; the last one stays then.
  Status update(const RobotState& state, const Setpoint* setpoint, JointVector& torque) noexcept;
  void reset(const JointVector& torque) noexcept;
  void release() noexcept;
  void closed_loop(analysis::System<kMaxJoints>& system) noexcept;
  void attach(const Attachment& attachment) noexcept;
  void limit_tip_speed(const TipSpeed& speed) noexcept;
  /// Returns K_I of `integral_stiffness` for the springs in force; empty if there is no integral.
  JointMatrix integral_stiffness() const noexcept;

  const Snapshot& snapshot() const noexcept { return snapshot_; }
  const Vibration& vibration() const noexcept { return vibration_.result(); }
  /// Returns the analysis of the sampled loop; null unless Analysis::Sampled asks for it.
  SampledAnalysis* sampled() noexcept { return sampled_.get(); }
  const Settings& settings() const noexcept { return settings_; }

 private:
  /// What the last torque was.
  enum class Springs : std::uint8_t {
    kInForce,
    kEnding,  ///< that of springs, which restart when they are next in force
    kOff,     ///< that of the brake; springs restart when they are next in force
  };
  /// The last set-point that was looked at, and whether it was in order.
  struct Look {
    std::int64_t time;
    bool in_order;
  };
  /// What the last analysis was of. qd and wrench are zero where they do not matter.
  struct Analysed {
    bool springs, gains_moved;
    std::uint64_t gain_changes;
    JointVector q, qd;
    Vector6 wrench;
    JointVector posture_error;  ///< no entries where it does not matter
  };

  // From the set-point to the law's torque:
  /// Takes over a set-point that is new and in order. Whether the one given is in order.
  bool accept_setpoint(const Setpoint& setpoint) noexcept;
  /// Springs that are to grow from zero start where the robot is.
  void start_new_springs() noexcept;
  /// Sets the goal of the accepted set-point. References whose springs are not in force start where
  /// the robot is.
  void update_goal() noexcept;
  /// Starts the springs where the robot is, with gains that grow from zero.
  void restart_springs() noexcept;
  /// Returns true if all references in force are at rest.
  bool references_still() const noexcept;
  /// Whether the set-point is fresh: kOk, kSetpointStale or kSetpointLost.
  Status setpoint_age_status() const noexcept;
  /// Returns the share of its speed limits at which the tip's reference takes no joint too fast.
  double tip_reference_speed() const noexcept;
  /// Returns the share of its speed limits at which the joints' reference takes the tip no faster
  /// than limit_tip_speed allows, where the robot is.
  double joint_reference_speed() const noexcept;
  /// Moves what is attached on by one period, and the tip's reference with the tool.
  void step_attachment() noexcept;
  /// Returns where the accepted set-point wants T, as far as T is on its way to its new place.
  Pose tip_goal() const noexcept;
  /// Moves gains and references on by one period, and sets the law's torque.
  void impedance_torque(bool hold, JointVector& tau) noexcept;
  /// The integral's step after a torque whose limits reported `limits`.
  void integrate(Status limits, bool hold) noexcept;

  /// Latches and releases faults. Returns kOk if the state allows springs, or kFaultLatched or
  /// worse.
  Status watch_motion(Status input, double dt) noexcept;
  /// True once the robot has been at rest for Watchdog::release_after.
  bool rested(double dt) noexcept;
  void latch(Status fault) noexcept;
  /// No springs act from now on. Returns what the arm is to do instead.
  SafetyFilter::Aim end_springs() noexcept;
  /// True if the brake acts alone, and does not stop the arm.
  bool brake_fails(Status now, double dt) noexcept;
  /// The safe output without a state.
  Status ramp(Status status, JointVector& tau) noexcept;
  Status finish(Status status, const JointVector& tau) noexcept;
  void show_measured(const RobotState& state) noexcept;
  void fill_snapshot() noexcept;

  // From the closed loop to its modes:
  void analyse() noexcept;
  /// Hands the closed loop to the analysis of the sampled loop.
  void hand_over() noexcept;
  /// Whether the closed loop is that of the last analysis, exactly.
  bool loop_unchanged(bool with_wrench, bool with_velocity) noexcept;
  /// Returns what the joints damp by themselves: their viscous friction, less, with springs in
  /// force, the slope of what compensates friction at the measured velocity.
  const JointVector& joint_friction() const noexcept {
    return springs_ == Springs::kOff ? viscous_friction_ : friction_left_;
  }
  /// Returns springs and dampers in force, or the brake in their place; valid until the next call.
  const Impedance& impedance() noexcept;

  const int n_;
  Settings settings_;
  Snapshot snapshot_;
  VibrationAnalysis vibration_;
  std::unique_ptr<SampledAnalysis> sampled_;

  DynamicsKernel kernel_;
  StateCheck state_check_;
  MotionWatch motion_watch_;
  BrakeDoubt doubt_;
  SpringReferences references_;
  GainBlend gains_;
  Ramp<Attachment> attachment_;
  Ramp<Vector6> wrench_;
  std::uint64_t integrated_ = 0;  ///< changes of gains and attachment that the integral knows of
  const std::optional<analysis::BorneDamping> borne_;  ///< none: any damping
  DesignedDamping designed_;
  ImpedanceLaw law_;
  SafetyFilter filter_;
  LoopSystem loop_;
  TipSpeed tip_speed_;  ///< of the reference, in either mode
  ErrorClamp clamp_;
  JointVector viscous_friction_;  ///< of the robot, N m s/rad
  JointVector friction_left_;     ///< by what compensates it, at small velocities; may be negative
  JointVector turn_;              ///< 2 pi for a continuous joint, else 0

  // The last good state, and the robot there
  std::int64_t time_ = 0;
  double setpoint_age_ = 0;  ///< ns, counted on, whatever the clock does after it was accepted
  JointVector q_, qd_;
  analysis::DampingLevel level_;  ///< of the ratios, at this tick
  JointVector weight_;            ///< what is compensated here of the gravity torque
  Vector6 external_wrench_ = Vector6::Zero();
  DynamicsResult robot_;

  Setpoint accepted_;  ///< the last good set-point
  JointVector goal_;   ///< its joint position
  Eigen::Quaterniond goal_rotation_ = Eigen::Quaterniond::Identity();
  bool from_user_ = false;    ///< or else it is Settings::initial, where the robot started
  std::optional<Look> look_;  ///< none yet
  std::optional<Analysed> analysed_;
  bool outside_;        ///< whether there is an environment
  Impedance combined_;  ///< of `impedance`

  bool first_ = true;  ///< there was no good state yet
  Springs springs_ = Springs::kOff;
  Status fault_ = Status::kOk;  ///< that latched
  double rest_ = 0;             ///< for how long the robot has been at rest since, s
  double restarts_ = 0;         ///< of the last second or so
  int ramp_ticks_ = 0;
};

}  // namespace dashpot::controller
