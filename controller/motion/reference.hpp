#pragma once
#include <dashpot/controller/base/orientation.hpp>
#include <dashpot/controller/motion/reference_governor.hpp>
#include <dashpot/controller/motion/smooth_motion.hpp>
#include <dashpot/controller/types.hpp>

namespace dashpot::controller {

/// Reference of the joint springs: the joint position at which they are fixed just now. From rest
/// it moves along a straight line in joint space, and all joints arrive together. Velocity and
/// acceleration keep to their limits, the acceleration is continuous, and the reference ends
/// exactly at its goal.
template <int N>
class JointReference {
 public:
  using Vector = Joints<N>;

  JointReference(const JointNorm<N>& norm, double period, int smoothing) noexcept
      : norm_(norm), period_(period), smoothing_(smoothing) {
    start(Vector::Zero());
  }

  /// Places the reference at rest at `position`.
  void start(const Vector& position) noexcept {
    point_ = position_ = position;
    velocity_.setZero();
    smoothing_.reset();
  }

  /// Moves one period toward `goal`.
  void step(const Vector& goal) noexcept {
    const Step<N> step = approach<N>(difference<N>(goal, point_), velocity_, norm_, period_);
    velocity_ = step.velocity;
    if (step.arrives) {
      point_ = goal;
    } else {
      add<N>(velocity_, point_, period_);
    }
    smooth();
  }

  /// Moves coordinate i to `position` and keeps its velocity.
  void relocate(int i, double position) noexcept {
    point_[i] += position - position_[i];
    position_[i] = position;
  }

  /// Brakes for one period, or stays at rest.
  void halt() noexcept {
    velocity_ = approach<N>(Vector::Zero(), velocity_, norm_, period_).velocity;
    add<N>(velocity_, point_, period_);
    smooth();
  }

  const Vector& position() const noexcept { return position_; }
  const Vector& velocity() const noexcept { return smoothing_.velocity(); }
  const Vector& acceleration() const noexcept { return smoothing_.acceleration(); }

 private:
  void smooth() noexcept {
    smoothing_.step(velocity_, period_);
    position_ = point_;
    add<N>(smoothing_.offset(), position_);
  }

  JointNorm<N> norm_;
  double period_;
  Smoothing<N> smoothing_;
  Vector point_;  ///< before smoothing
  Vector velocity_;
  Vector position_;
};

/// Returns the rotation vector of a unit quaternion, the short way round.
inline Eigen::Vector3d short_turn(Eigen::Quaterniond turn) noexcept {
  if (turn.w() < 0) turn.coeffs() = -turn.coeffs();
  return rotation_vector(turn);
}

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
/// follow or is led away, and returns from there: nothing winds up.
class TipReference {
 public:
  TipReference(const TwistNorm& norm, double period, int smoothing) noexcept
      : norm_(norm), period_(period), smoothing_(smoothing) {}

  /// Places the reference at rest at a pose.
  void start(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation) noexcept {
    point_ = position_ = position;
    point_rotation_ = rotation_ = rotation;
    velocity_.setZero();
    smoothing_.reset();
  }

  /// Moves the reference to a pose and keeps its velocity.
  void relocate(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation) noexcept {
    point_ += position - position_;
    position_ = position;
    rotation_ = rotation;
    point_rotation_ = quaternion(-smoothing_.offset().tail<3>()) * rotation;
  }

  /// Moves one period toward a goal; `rotation` is a unit quaternion.
  void step(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation) noexcept {
    go(position, rotation, way_to(position, rotation), true, 1);
  }
  /// Moves one period toward a goal within the governor's clamp, with a `share` of the speed
  /// limits, from 0 to 1.
  void step(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation,
            const ReferenceGovernor& governor, double share = 1) noexcept {
    const Vector6 d = way_to(position, rotation);
    if (governor.near(position, rotation)) return go(position, rotation, d, true, share);
    Vector6 e;  // of the reference before smoothing
    e << point_ - governor.position, short_turn(point_rotation_ * governor.rotation.conjugate());
    const Vector6 goal = e + d;
    const Vector6 within = governor.clamped(goal);
    if (within == goal) return go(position, rotation, d, true, share);
    go(position, rotation, within - e, false, share);
  }

  /// Brakes for one period, or stays at rest.
  void halt() noexcept {
    velocity_ = approach<6>(Vector6::Zero(), velocity_, norm_, period_).velocity;
    advance();
    smooth();
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
                 const Eigen::Quaterniond& rotation) const noexcept {
    Vector6 d;
    d << position - point_, short_turn(rotation * point_rotation_.conjugate());
    if (d.tail<3>().norm() < 1e-14) d.tail<3>().setZero();  // rounding of the product
    return d;
  }
  /// Moves one period along the difference `d`, which `ends` at the given goal or before it.
  void go(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation, const Vector6& d,
          bool ends, double share) noexcept {
    const Step<6> step = approach<6>(d, velocity_, norm_, period_, share);
    velocity_ = step.velocity;
    if (step.arrives && ends) {
      point_ = position;
      point_rotation_ = rotation;
    } else {
      advance();
    }
    smooth();
  }
  void advance() noexcept {
    point_ += period_ * velocity_.head<3>();
    if ((velocity_.tail<3>().array() == 0).all()) return;
    point_rotation_ = quaternion(period_ * velocity_.tail<3>()) * point_rotation_;
    point_rotation_.normalize();
  }
  void smooth() noexcept {
    smoothing_.step(velocity_, period_);
    position_ = point_ + smoothing_.offset().head<3>();
    rotation_ = quaternion(smoothing_.offset().tail<3>()) * point_rotation_;
  }

  TwistNorm norm_;
  double period_;
  Smoothing<6> smoothing_;
  Eigen::Vector3d point_ = Eigen::Vector3d::Zero();  ///< before smoothing
  Eigen::Quaterniond point_rotation_ = Eigen::Quaterniond::Identity();
  Vector6 velocity_ = Vector6::Zero();
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
};

}  // namespace dashpot::controller
