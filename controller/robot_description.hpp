#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <string>

namespace dashpot::controller {

/// What a RobotModel is made from, or another program's model of the same robot.
struct RobotDescription {
  std::string urdf;  ///< path
  std::string base, tip;
  ModelOptions options;
  std::string text = {};  ///< of the URDF where it is known; empty: it is read from the file

  /// Returns the model. Throws InvalidModel.
  RobotModel model() const {
    return text.empty() ? RobotModel::from_urdf_file(urdf, base, tip, options)
                        : RobotModel::from_urdf_text(text, base, tip, options, urdf);
  }
};

}  // namespace dashpot::controller
