#pragma once
#include <dashpot/controller/attachment.hpp>

#include <kdl/chain.hpp>

namespace dashpot::controller {

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
