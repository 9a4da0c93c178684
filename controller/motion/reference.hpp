#pragma once
#include <dashpot/controller/base/orientation.hpp>
#include <dashpot/controller/motion/reference_governor.hpp>
#include <dashpot/controller/motion/smooth_motion.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Reference of the joint springs: the joint position at which they are fixed just now. From rest
/// it moves along a straight line in joint space, and all joints arrive together. Velocity and
/// acceleration keep to their limits, the acceleration is continuous, and the reference ends
/// exactly at its goal.
class JointReference {
 public:
  JointReference(const JointNorm& norm, double period, int smoothing) noexcept;

  /// Places the reference at rest at `position`.
  void start(const JointVector& position) noexcept;
  /// Moves one period toward `goal`, with a `share` of the speed limits, from 0 to 1.
  void step(const JointVector& goal, double share = 1) noexcept;
  /// Moves coordinate i to `position` and keeps its velocity.
  void relocate(int i, double position) noexcept {
    point_[i] += position - position_[i];
    position_[i] = position;
  }
  /// Brakes for one period, or stays at rest.
  void halt() noexcept { step(point_); }

  const JointVector& position() const noexcept { return position_; }
  const JointVector& velocity() const noexcept { return smoothing_.velocity(); }
  const JointVector& acceleration() const noexcept { return smoothing_.acceleration(); }
  /// Returns the velocity before smoothing, and its share of the speed limits.
  const JointVector& point_velocity() const noexcept { return velocity_; }
  double speed() const noexcept { return norm_.speed(velocity_); }

 private:
  JointNorm norm_;
  double period_;
  JointVector point_;  ///< before smoothing
  JointVector velocity_;
  JointVector position_;
  Smoothing<JointVector> smoothing_;
};

/// Returns the rotation vector of a unit quaternion, the short way round.
Eigen::Vector3d short_turn(Eigen::Quaterniond turn) noexcept;

/// Reference of the Cartesian springs: the pose at which they are fixed just now. From rest it
/// moves along a straight line and turns about one axis, the short way round, and both arrive
/// together.
///
/// The smoothed orientation is exp(offset) times the orientation before smoothing, and its angular
/// velocity is the average of the angular velocities before smoothing. That is exact while the axis
/// of rotation stands still. Where a new goal changes the axis in motion, the two differ by a
/// fraction |offset| (rad) of the angular velocity.
///
/// A ReferenceGovernor keeps the reference within the error clamp of the tip. With d the difference
/// from reference to goal and e the difference from tip to reference (m, and rad as a rotation
/// vector), the reference moves along
///     ErrorClamp::clamped(e + d) - e.
/// So it brakes for the edge of the clamp as for a goal, moves along with a robot that cannot
/// follow or is moved by force, and returns from there without wind-up.
class TipReference {
 public:
  TipReference(const TwistNorm& norm, double period, int smoothing) noexcept
      : norm_(norm), period_(period), smoothing_(smoothing, 6) {}

  /// Places the reference at rest at a pose.
  void start(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation) noexcept;
  /// Moves the reference to a pose and keeps its velocity.
  void relocate(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation) noexcept;

  /// Moves one period toward a goal; `rotation` is a unit quaternion.
  void step(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation) noexcept {
    go(position, rotation, way_to(position, rotation), true, 1);
  }
  /// Moves one period toward a goal within the governor's clamp, with a `share` of the speed
  /// limits, from 0 to 1.
  void step(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation,
            const ReferenceGovernor& governor, double share = 1) noexcept;
  /// Brakes for one period, or stays at rest.
  void halt() noexcept { go(point_, point_rotation_, Vector6::Zero(), true, 1); }
  /// Sets the limits of velocity, m/s and rad/s, both above zero.
  void limit_speed(double linear, double angular) noexcept {
    norm_.linear_velocity = linear;
    norm_.angular_velocity = angular;
  }

  const Eigen::Vector3d& position() const noexcept { return position_; }
  const Eigen::Quaterniond& rotation() const noexcept { return rotation_; }
  const Vector6& velocity() const noexcept { return smoothing_.velocity(); }
  const Vector6& acceleration() const noexcept { return smoothing_.acceleration(); }
  /// Returns the velocity before smoothing, m/s and rad/s, and its share of the speed limits.
  const Vector6& point_velocity() const noexcept { return velocity_; }
  double speed() const noexcept { return norm_.speed(velocity_); }

 private:
  Vector6 way_to(const Eigen::Vector3d& position,
                 const Eigen::Quaterniond& rotation) const noexcept;
  /// Moves one period along the difference `d`, which `ends` at the given goal or before it.
  void go(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation, const Vector6& d,
          bool ends, double share) noexcept;

  TwistNorm norm_;
  double period_;
  Eigen::Vector3d point_ = Eigen::Vector3d::Zero();  ///< before smoothing
  Eigen::Quaterniond point_rotation_ = Eigen::Quaterniond::Identity();
  Vector6 velocity_ = Vector6::Zero();
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
  Smoothing<Vector6> smoothing_;
};

/// References of all springs.
struct SpringReferences {
  JointReference joint;    ///< of mode kJoint: q_d
  JointReference posture;  ///< posture of a redundant arm: q_0
  TipReference tip;        ///< of mode kCartesian: p_d, R_d and twist V_d

  /// References at rest at zero.
  SpringReferences(const Motion& motion, double period) noexcept;
};

}  // namespace dashpot::controller
