#pragma once
#include <dashpot/controller/core/setpoint_history.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/motion/reference.hpp>

namespace dashpot::controller {

/// Moves the references of the springs to the goals, as fast as the limits of tip and joints allow
/// at the robot's posture. A reference whose springs do not act starts where the robot is; while
/// modes blend, the reference of the mode that fades stays.
class ReferenceGenerator {
 public:
  ReferenceGenerator(const RobotModel& model, const Settings& settings);

  /// Sets limits of the tip's speed for the references in either mode.
  void limit_tip_speed(const TipSpeed& speed) noexcept;
  /// Moves the tip's reference along as T goes from one place on the tip link to another.
  void carry(const Pose& from, const Pose& to) noexcept;
  /// Sets the goal of the setpoints. With new gains, springs that are to grow from zero start where
  /// the robot is.
  void set_goal(const SetpointHistory& setpoints, bool new_gains, const Sensed& now) noexcept;
  /// Moves references on by one period, in `hold` to rest.
  void step(const SetpointHistory& setpoints, bool hold, const Sensed& now,
            const NullSpace& null_space) noexcept;

  const SpringReferences& references() const noexcept { return references_; }
  const ErrorClamp& clamp() const noexcept { return clamp_; }
  /// Returns true if the references of all active springs are at rest.
  bool still(const Impedance& impedance) const noexcept;

 private:
  void start_new_springs(const GainBlend& gains, const Sensed& sensed) noexcept;
  /// Returns the share of its speed limits at which the tip's reference moves no joint too fast; it
  /// rises slowly.
  double tip_share(const NullSpace& null_space) noexcept;
  /// Returns the share of its speed limits at which the joints' reference takes the tip no faster
  /// than limit_tip_speed allows.
  double joint_share(const Jacobian& J) const noexcept;

  const Settings settings_;
  SpringReferences references_;
  ErrorClamp clamp_;
  TipSpeed tip_speed_;  ///< of the references
  double tip_share_ = 1;
  JointVector turn_;  ///< 2 pi for a continuous joint, else 0
  JointVector goal_;  ///< of the joints, or of the posture
};

}  // namespace dashpot::controller
