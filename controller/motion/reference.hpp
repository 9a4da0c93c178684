#pragma once
#include <dashpot/controller/base/impedance.hpp>
#include <dashpot/controller/base/orientation.hpp>
#include <dashpot/controller/motion/smooth_motion.hpp>
#include <dashpot/controller/settings.hpp>

#include <Eigen/Geometry>
#include <numbers>

namespace dashpot::controller {

/// Returns which directions of a frame have springs, 1 or 0 for each. K is positive semidefinite,
/// so that a row is zero if its diagonal entry is.
inline Vector6 sprung(const Matrix6& K) noexcept {
  Vector6 result;
  for (int i = 0; i < 6; ++i) result[i] = K(i, i) > 0 ? 1 : 0;
  return result;
}

/// Limits the deflection of the tip's springs: e (m, and rad as a rotation vector) becomes
///     e - (1 - min(1, r / |e_s|)) e_s,
/// linear and angular part each by itself. e_s is the part of e in directions that have springs,
/// and r is the limit. Less deflection is less energy: e' K e becomes no larger if K does not
/// couple the two parts.
struct ErrorClamp {
  double linear = 0;   ///< m
  double angular = 0;  ///< rad

  Vector6 clamped(const Vector6& e, const TipImpedance& base, const TipImpedance& tool,
                  const Eigen::Matrix3d& R_BT) const noexcept {
    if (e.head<3>().norm() <= linear && e.tail<3>().norm() <= angular) return e;
    Vector6 e_s = e;  // all of e while springs blend from one frame to the other
    if (tool.none()) {
      e_s = part_along(sprung(base.stiffness), Eigen::Matrix3d::Identity(), e);
    } else if (base.none()) {
      e_s = part_along(sprung(tool.stiffness), R_BT, e);
    }
    const double far = e_s.head<3>().norm(), turned = e_s.tail<3>().norm();
    Vector6 result = e;
    if (far > linear) result.head<3>() -= (1 - linear / far) * e_s.head<3>();
    if (turned > angular) result.tail<3>() -= (1 - angular / turned) * e_s.tail<3>();
    return result;
  }
};

/// Keeps the tip's reference within the error clamp. It knows the pose of the tip, and the springs
/// between tip and reference.
struct ReferenceGovernor {
  const Eigen::Vector3d& position;
  const Eigen::Quaterniond& rotation;
  const Eigen::Matrix3d& R_BT;  ///< of `rotation`
  const TipImpedance& base;
  const TipImpedance& tool;
  const ErrorClamp& clamp;

  Vector6 clamped(const Vector6& e) const noexcept { return clamp.clamped(e, base, tool, R_BT); }
  /// Returns true if a cheap bound shows that a pose is within the clamp: the angle between two
  /// unit quaternions is at most pi sqrt(1 - (their product)^2).
  bool near(const Eigen::Vector3d& p, const Eigen::Quaterniond& q) const noexcept {
    const double cosine = q.dot(rotation);
    return (p - position).squaredNorm() <= clamp.linear * clamp.linear &&
           std::numbers::pi * std::numbers::pi * (1 - cosine * cosine) <=
               clamp.angular * clamp.angular;
  }
};

/// Returns the deflection e of springs that change from `now` to `then` without its part in the
/// directions of new springs, so that springs that grow from zero start without deflection.
inline Vector6 without_new_springs(const Vector6& e, const TipImpedance& now_base,
                                   const TipImpedance& now_tool, const TipImpedance& then_base,
                                   const TipImpedance& then_tool,
                                   const Eigen::Matrix3d& R_BT) noexcept {
  const bool in_tool = !then_tool.none();
  const Matrix6 now =
      in_tool ? Matrix6(now_tool.stiffness + turned(now_base.stiffness, R_BT.transpose()))
              : Matrix6(now_base.stiffness + turned(now_tool.stiffness, R_BT));
  const Vector6 then = sprung(in_tool ? then_tool.stiffness : then_base.stiffness);
  const Vector6 fresh = then.cwiseProduct(Vector6::Ones() - sprung(now));
  return e - part_along(fresh, in_tool ? R_BT : Eigen::Matrix3d::Identity(), e);
}

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
