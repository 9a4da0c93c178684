#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/model/rigid_bodies.hpp>

#include <Eigen/Geometry>

namespace dashpot::controller {
namespace {

/// |p|^2 1 - p p': the inertia of 1 kg at p.
Eigen::Matrix3d of_point(const Eigen::Vector3d& p) noexcept {
  return p.squaredNorm() * Eigen::Matrix3d::Identity() - p * p.transpose();
}

}  // namespace

Attachment::Attachment(const Payload& payload, const Pose& given)
    : mass(payload.mass),
      first_moment(payload.mass * payload.center),
      inertia(payload.inertia + payload.mass * of_point(payload.center)),
      tool(given) {
  std::string problem = mass_problem(payload.mass, payload.center, payload.inertia);
  if (problem.empty()) problem = inertia_problem(payload.mass, payload.inertia);
  if (!problem.empty()) throw InvalidModel("payload: " + problem);
  if (!first_moment.allFinite() || !inertia.allFinite()) throw InvalidModel("payload: too large");
  const Eigen::Matrix3d& R = given.rotation;
  const bool turns = (R.transpose() * R).isIdentity(1e-9) && R.determinant() > 0;
  if (!turns || !given.position.allFinite()) {
    throw InvalidModel("tool: not a rotation and a finite position");
  }
}

Payload Attachment::payload() const noexcept {
  if (mass == 0) return {0, Eigen::Vector3d::Zero(), inertia};
  const Eigen::Vector3d center = first_moment / mass;
  return {mass, center, inertia - mass * of_point(center)};
}

bool Attachment::operator==(const Attachment& other) const noexcept {
  return mass == other.mass && first_moment == other.first_moment && inertia == other.inertia &&
         tool.position == other.tool.position && tool.rotation == other.tool.rotation;
}

Attachment blend(const Attachment& a, const Attachment& b, double s) noexcept {
  const double r = 1 - s;
  Attachment c;
  c.mass = r * a.mass + s * b.mass;
  c.first_moment = r * a.first_moment + s * b.first_moment;
  c.inertia = r * a.inertia + s * b.inertia;
  c.tool.position = r * a.tool.position + s * b.tool.position;
  c.tool.rotation = a.tool.rotation;
  if (a.tool.rotation != b.tool.rotation) {
    const Eigen::Quaterniond from(a.tool.rotation), to(b.tool.rotation);
    c.tool.rotation = from.slerp(s, to).normalized().toRotationMatrix();
  }
  return c;
}

Pose carried(const Pose& pose, const Pose& from, const Pose& to) noexcept {
  if (from.position == to.position && from.rotation == to.rotation) return pose;
  const Eigen::Matrix3d R = pose.rotation * from.rotation.transpose();
  return {pose.position + R * (to.position - from.position), R * to.rotation};
}

}  // namespace dashpot::controller
