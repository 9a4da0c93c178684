#pragma once
// The four arms of sim/models.

#include <dashpot/controller/robot_model.hpp>

#include <string>
#include <vector>

namespace dashpot::testing {

struct Arm {
  const char* file;
  const char* base;
  const char* tip;
};

inline const std::vector<Arm>& arms() {
  static const std::vector<Arm> all = {
      {"panda", "panda_link0", "panda_hand_tcp"},
      {"iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka"},
      {"ur5", "base_link", "ee_link"},
      {"baxter_left", "left_arm_mount", "left_gripper"},
  };
  return all;
}

inline std::string arm_path(const std::string& file) {
  return std::string(DASHPOT_SOURCE_DIR) + "/sim/models/" + file + ".urdf";
}

inline controller::RobotModel arm_model(const Arm& arm,
                                        const controller::ModelOptions& options = {}) {
  return controller::RobotModel::from_urdf_file(arm_path(arm.file), arm.base, arm.tip, options);
}

inline controller::RobotModel panda_model() {
  return arm_model(arms()[0]);
}

}  // namespace dashpot::testing
