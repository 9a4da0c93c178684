#pragma once
// The arms of sim/models.

#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/places.hpp>

#include <ostream>
#include <string>
#include <vector>

namespace dashpot::testing {

struct Arm {
  const char* file;
  const char* base;
  const char* tip;
  friend void PrintTo(const Arm& arm, std::ostream* out) { *out << arm.file; }
};

inline std::ostream& operator<<(std::ostream& out, const Arm& arm) {
  return out << arm.file;
}

/// The four on which most tests are run.
inline const std::vector<Arm>& arms() {
  static const std::vector<Arm> all = {
      {"panda", "panda_link0", "panda_hand_tcp"},
      {"iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka"},
      {"ur5", "base_link", "ee_link"},
      {"baxter_left", "left_arm_mount", "left_gripper"},
  };
  return all;
}

/// These and the others, for tests of the models themselves.
inline std::vector<Arm> all_arms() {
  std::vector<Arm> all = arms();
  all.insert(all.end(), {{"iiwa7", "iiwa_link_0", "iiwa_link_ee_kuka"},
                         {"fr3", "fr3_link0", "fr3_hand_tcp"},
                         {"gen3", "base_link", "end_effector_link"},
                         {"xarm7", "link_base", "link_eef"}});
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
