#pragma once
// A chain in KDL, built straight from the URDF and without any code of the simulator.

#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/support/kdl_solvers.hpp>

#include <urdf_parser/urdf_parser.h>

#include <kdl/chain.hpp>
#include <vector>

namespace dashpot::testing {

inline KDL::Vector kdl(const urdf::Vector3& v) {
  return {v.x, v.y, v.z};
}

inline KDL::Frame kdl(const urdf::Pose& pose) {
  return {
      KDL::Rotation::Quaternion(pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w),
      kdl(pose.position)};
}

inline KDL::RigidBodyInertia kdl(const urdf::Inertial& i) {
  const KDL::Frame origin = kdl(i.origin);
  const KDL::RotationalInertia moments(i.ixx, i.iyy, i.izz, i.ixy, i.ixz, i.iyz);
  const KDL::RigidBodyInertia turned =
      origin.M * KDL::RigidBodyInertia(0, KDL::Vector::Zero(), moments);
  return KDL::RigidBodyInertia(i.mass, origin.p, turned.getRotationalInertia());
}

/// Links off the chain are not counted.
inline KDL::Chain kdl_chain(const ChainFile& file) {
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(file.urdf);
  std::vector<urdf::LinkConstSharedPtr> links;
  for (urdf::LinkConstSharedPtr link = model->getLink(file.tip); link->name != file.base;
       link = link->getParent()) {
    links.insert(links.begin(), link);
  }
  KDL::Chain chain;
  for (const urdf::LinkConstSharedPtr& link : links) {
    const urdf::Joint& joint = *link->parent_joint;
    const KDL::Frame frame = kdl(joint.parent_to_joint_origin_transform);
    const KDL::Vector axis = frame.M * kdl(joint.axis);
    KDL::Joint moving(joint.name, KDL::Joint::None);
    if (joint.type == urdf::Joint::PRISMATIC) {
      moving = KDL::Joint(joint.name, frame.p, axis, KDL::Joint::TransAxis);
    } else if (joint.type != urdf::Joint::FIXED) {
      moving = KDL::Joint(joint.name, frame.p, axis, KDL::Joint::RotAxis);
    }
    chain.addSegment(
        KDL::Segment(link->name, moving, frame,
                     link->inertial ? kdl(*link->inertial) : KDL::RigidBodyInertia::Zero()));
  }
  return chain;
}

/// KDL's solvers for that chain.
class KdlReference {
 public:
  KdlReference(const ChainFile& file, const Eigen::Vector3d& gravity)
      : solvers_(kdl_chain(file), gravity.data()) {}

  struct Terms {
    Eigen::MatrixXd M, J;
    Eigen::VectorXd coriolis, gravity;
    Eigen::Vector3d tip_position;
    Eigen::Matrix3d tip_rotation;
  };
  Terms at(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) {
    solvers_.solve(q.data(), qd.data());
    const KdlTerms terms = solvers_.terms();
    const auto matrix = [](const auto& values, Eigen::Index rows, Eigen::Index cols) {
      return Eigen::Map<const Eigen::MatrixXd>(&values[0], rows, cols);
    };
    const Eigen::Index n = q.size();
    return {matrix(terms.M, n, n),        matrix(terms.J, 6, n),
            matrix(terms.coriolis, n, 1), matrix(terms.gravity, n, 1),
            matrix(terms.position, 3, 1), matrix(terms.rotation, 3, 3)};
  }

 private:
  KdlSolvers solvers_;
};

}  // namespace dashpot::testing
