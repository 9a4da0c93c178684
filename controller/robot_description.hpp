#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <string>

namespace dashpot::controller {

/// What a RobotModel is made from, or another program's model of the same robot.
struct RobotDescription {
  std::string urdf;  ///< path
  std::string base, tip;
  ModelOptions options;

  /// Returns the model. Throws InvalidModel.
  RobotModel model() const { return RobotModel::from_urdf_file(urdf, base, tip, options); }
};

}  // namespace dashpot::controller
