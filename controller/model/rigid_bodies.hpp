#pragma once
// From URDF's poses and inertias to KDL's, and their checks.

#include <dashpot/controller/robot_model.hpp>

#include <urdf_model/model.h>
#include <kdl/rigidbodyinertia.hpp>

#include <string>

namespace dashpot::controller {

KDL::Vector to_kdl(const Eigen::Vector3d& v);
KDL::Rotation to_kdl(const Eigen::Matrix3d& R);
KDL::Vector to_kdl(const urdf::Vector3& v);
KDL::Frame to_kdl(const urdf::Pose& pose);

/// "" if a body of this mass (kg) and centre of mass (m) can exist, and else what is wrong.
std::string mass_problem(double mass, const Eigen::Vector3d& center,
                         const Eigen::Matrix3d& inertia);

/// "" if a body of this mass (kg) can have this inertia about its centre of mass (kg m^2), and else
/// what is wrong. Published inertias are rounded, so the triangle inequality may be broken by half
/// a percent of the largest principal moment, and moments may be as little below zero; besides by
/// that of the mass one micrometre away, 1e-12 m^2 times the mass (at least 1 mg), because programs
/// that export them leave rounding errors where a moment is zero. Rods and point masses can exist.
std::string inertia_problem(double mass, const Eigen::Matrix3d& inertia);

/// Inertia of the link alone, about its origin, in its axes; zero for a link without one. Throws
/// InvalidModel, whose text begins with `name`; not for an inertia that no body can have if
/// `accept`.
KDL::RigidBodyInertia body_of(const urdf::Link& link, bool accept, const std::string& name);

/// The same of a payload, in the axes of the tip link.
KDL::RigidBodyInertia body_of(const Payload& payload, const std::string& name);

}  // namespace dashpot::controller
