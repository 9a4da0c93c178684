#pragma once
// The same chain in KDL, built straight from the URDF and without any code of the simulator.

#include <dashpot/tests/sim/chains.hpp>

#include <urdf_parser/urdf_parser.h>

#include <kdl/chain.hpp>
#include <kdl/jntarray.hpp>
#include <kdl/jntspaceinertiamatrix.hpp>
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

// KDL was compiled for another alignment of Eigen matrices: theirs are read and written entry by
// entry, through KDL's own functions.

inline KDL::JntArray kdl(const Eigen::VectorXd& v) {
  KDL::JntArray array(static_cast<unsigned>(v.size()));
  for (unsigned i = 0; i < array.rows(); ++i) array(i) = v[i];
  return array;
}

inline Eigen::VectorXd eigen(const KDL::JntArray& array) {
  Eigen::VectorXd v(array.rows());
  for (unsigned i = 0; i < array.rows(); ++i) v[i] = array(i);
  return v;
}

/// Of a KDL::Jacobian or KDL::JntSpaceInertiaMatrix.
template <class Matrix>
Eigen::MatrixXd eigen(const Matrix& matrix) {
  Eigen::MatrixXd A(matrix.rows(), matrix.columns());
  for (unsigned i = 0; i < matrix.rows(); ++i) {
    for (unsigned j = 0; j < matrix.columns(); ++j) A(i, j) = matrix(i, j);
  }
  return A;
}

}  // namespace dashpot::testing
