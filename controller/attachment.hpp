#pragma once
#include <dashpot/controller/robot_model.hpp>

namespace dashpot::controller {

/// What is attached to the tip link: a payload, and the tool's frame T. It may change while the
/// loop runs. The body is kept as mass, first moment and inertia about the tip link's origin, in
/// which M and the gravity torque are linear, so that a weighted mean of two bodies is a body.
struct Attachment {
  double mass = 0;                                         ///< kg
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();  ///< mass times centre, kg m
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();       ///< about the origin, kg m^2
  Pose tool;                                               ///< T in the tip link

  /// Nothing, with T at the tip link.
  Attachment() = default;
  /// Throws InvalidModel unless a body can be so and the tool is a rotation and a position.
  Attachment(const Payload& payload, const Pose& given);

  /// Returns the body as a payload: its centre of mass, and the inertia about that.
  Payload payload() const noexcept;
  bool operator==(const Attachment& other) const noexcept;
};

/// Returns (1 - s) a + s b; the tool's rotation goes the short way from a to b.
Attachment blend(const Attachment& a, const Attachment& b, double s) noexcept;

/// Returns where the frame `to` of the tip link is (in B), if its frame `from` is at `pose`.
Pose carried(const Pose& pose, const Pose& from, const Pose& to) noexcept;

}  // namespace dashpot::controller
