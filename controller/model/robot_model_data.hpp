#pragma once
// The data of a RobotModel; converts URDF's poses and inertias to KDL's, and checks them.
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/robot_model.hpp>

#include <urdf_model/model.h>
#include <kdl/chain.hpp>
#include <kdl/rigidbodyinertia.hpp>
#include <string>

namespace dashpot::controller {

KDL::Vector to_kdl(const Eigen::Vector3d& v);
KDL::Rotation to_kdl(const Eigen::Matrix3d& R);
KDL::Vector to_kdl(const urdf::Vector3& v);
KDL::Frame to_kdl(const urdf::Pose& pose);

/// Returns what is wrong with a mass (kg) and a centre of mass (m); "" if such a body can exist.
std::string mass_problem(double mass, const Eigen::Vector3d& center,
                         const Eigen::Matrix3d& inertia);

/// Returns what is wrong with the inertia of a body about its centre of mass (kg m^2); "" if a body
/// of this mass (kg) can have it. The triangle inequality may be broken by half a percent of the
/// largest principal moment, and moments may be as little below zero, because published inertias
/// are rounded. A further 1e-12 m^2 times the mass (at least 1 mg), the moment of the mass one
/// micrometre away, is allowed as well, because programs that export inertias leave rounding errors
/// where a moment is zero. Rods and point masses can exist.
std::string inertia_problem(double mass, const Eigen::Matrix3d& inertia);

/// A link's inertia, and what is wrong with it.
struct LinkBody {
  std::string link;
  KDL::RigidBodyInertia body;  ///< about the link's origin, in its axes; zero if there is none
  double moment = 0;           ///< largest entry of the inertia about the centre of mass, kg m^2
  std::string problem;         ///< "" if such a body can exist
  bool possible = false;       ///< mass and centre are; only the inertia has the problem
};

LinkBody body_of(const urdf::Link& link);

struct RobotModel::Data {
  std::string name;
  std::string base;
  std::string tip;
  std::vector<Joint> joints;
  Eigen::Vector3d gravity;
  KDL::Chain chain;                 ///< as kdl_chain.hpp says
  KDL::RigidBodyInertia last_body;  ///< of the last joint, without what is attached
  KDL::Frame tip_link;              ///< in the last joint's segment
  Attachment attachment;
  std::vector<std::string> warnings;
  PositionSensor position_sensor = PositionSensor::kMotor;

  /// Puts what is attached into the chain's last two segments.
  void attach(const Attachment& given);
};

}  // namespace dashpot::controller
