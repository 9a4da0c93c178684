#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <kdl/chain.hpp>

namespace dashpot::controller {

struct RobotModel::Data {
  std::string name;
  std::string base;
  std::string tip;
  std::vector<Joint> joints;
  Eigen::Vector3d gravity;
  KDL::Chain chain;  ///< as kdl_chain.hpp says
};

}  // namespace dashpot::controller
