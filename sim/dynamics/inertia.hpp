#pragma once
#include <dashpot/sim/joint_types.hpp>

namespace dashpot::sim {

/// Mass distribution of a rigid body.
struct Inertia {
  double mass = 0;                                         ///< kg
  Eigen::Vector3d center = Eigen::Vector3d::Zero();        ///< of mass, m
  Eigen::Matrix3d about_center = Eigen::Matrix3d::Zero();  ///< kg m^2
};

/// Returns the pose of c in a, from the pose of b in a and of c in b.
inline Pose operator*(const Pose& a, const Pose& b) {
  return {a.position + a.rotation * b.position, a.rotation * b.rotation};
}

/// Returns the inertia in the frame in which the body's frame has this pose.
inline Inertia operator*(const Pose& pose, const Inertia& body) {
  return {body.mass, pose.position + pose.rotation * body.center,
          pose.rotation * body.about_center * pose.rotation.transpose()};
}

/// Returns the inertia of a mass about a point that is off it by r: m (r.r 1 - r r').
inline Eigen::Matrix3d parallel_axes(double mass, const Eigen::Vector3d& r) {
  return mass * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
}

/// Returns the inertia of two bodies joined rigidly.
inline Inertia operator+(const Inertia& a, const Inertia& b) {
  const double mass = a.mass + b.mass;
  if (mass == 0) return {0, Eigen::Vector3d::Zero(), a.about_center + b.about_center};
  const Eigen::Vector3d center = (a.mass * a.center + b.mass * b.center) / mass;
  return {mass, center,
          a.about_center + parallel_axes(a.mass, a.center - center) + b.about_center +
              parallel_axes(b.mass, b.center - center)};
}

inline Inertia& operator+=(Inertia& a, const Inertia& b) {
  return a = a + b;
}

}  // namespace dashpot::sim
