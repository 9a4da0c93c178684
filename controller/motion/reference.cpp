#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/motion/reference.hpp>

namespace dashpot::controller {

JointReference::JointReference(const JointNorm& norm, double period, int smoothing) noexcept
    : norm_(norm),
      period_(period),
      point_(JointVector::Zero(norm.velocity.size())),
      velocity_(point_),
      position_(point_),
      smoothing_(smoothing, static_cast<int>(point_.size())) {}

void JointReference::start(const JointVector& position) noexcept {
  point_ = position_ = position;
  velocity_.setZero();
  smoothing_.reset();
}

void JointReference::step(const JointVector& goal, double share) noexcept {
  if (approach(difference(goal, point_), velocity_, norm_, period_, share)) {
    point_ = goal;
  } else {
    add(velocity_, point_, period_);
  }
  smoothing_.step(velocity_, period_);
  for (Eigen::Index i = 0; i < point_.size(); ++i) {
    position_[i] = point_[i] + smoothing_.offset()[i];
  }
}

Eigen::Vector3d short_turn(Eigen::Quaterniond turn) noexcept {
  if (turn.w() < 0) turn.coeffs() = -turn.coeffs();
  return rotation_vector(turn);
}

void TipReference::start(const Eigen::Vector3d& position,
                         const Eigen::Quaterniond& rotation) noexcept {
  point_ = position_ = position;
  point_rotation_ = rotation_ = rotation;
  velocity_.setZero();
  smoothing_.reset();
}

void TipReference::relocate(const Eigen::Vector3d& position,
                            const Eigen::Quaterniond& rotation) noexcept {
  point_ += position - position_;
  position_ = position;
  rotation_ = rotation;
  point_rotation_ = quaternion(-smoothing_.offset().tail<3>()) * rotation;
}

void TipReference::step(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation,
                        const ReferenceGovernor& governor, double share) noexcept {
  const Vector6 d = way_to(position, rotation);
  if (governor.near(position, rotation)) return go(position, rotation, d, true, share);
  Vector6 e;  // of the reference before smoothing
  e << point_ - governor.position, short_turn(point_rotation_ * governor.rotation.conjugate());
  const Vector6 goal = e + d;
  const Vector6 within = governor.clamped(goal);
  if (within == goal) return go(position, rotation, d, true, share);
  go(position, rotation, within - e, false, share);
}

Vector6 TipReference::way_to(const Eigen::Vector3d& position,
                             const Eigen::Quaterniond& rotation) const noexcept {
  Vector6 d;
  d << position - point_, short_turn(rotation * point_rotation_.conjugate());
  if (d.tail<3>().norm() < 1e-14) d.tail<3>().setZero();  // rounding of the product
  return d;
}

void TipReference::go(const Eigen::Vector3d& position, const Eigen::Quaterniond& rotation,
                      const Vector6& d, bool ends, double share) noexcept {
  const bool arrives = approach(d, velocity_, norm_, period_, share);
  if (arrives && ends) {
    point_ = position;
    point_rotation_ = rotation;
  } else {
    point_ += period_ * velocity_.head<3>();
    if ((velocity_.tail<3>().array() != 0).any()) {
      point_rotation_ = quaternion(period_ * velocity_.tail<3>()) * point_rotation_;
      point_rotation_.normalize();
    }
  }
  smoothing_.step(velocity_, period_);
  position_ = point_ + smoothing_.offset().head<3>();
  rotation_ = quaternion(smoothing_.offset().tail<3>()) * point_rotation_;
}

/// Ticks over which references are smoothed.
static int window(const Motion& motion, double period) {
  return static_cast<int>(std::lround(motion.smoothing / period));
}

SpringReferences::SpringReferences(const Motion& motion, double period) noexcept
    : joint({motion.velocity, motion.acceleration}, period, window(motion, period)),
      posture(joint),
      tip({motion.linear_velocity, motion.angular_velocity, motion.linear_acceleration,
           motion.angular_acceleration},
          period, window(motion, period)) {}

}  // namespace dashpot::controller
