#pragma once
// The robots that the safety of the plugin is shown on, and plugins of any version from 4 on, as a
// host loads them that does not ask for their table of functions.

#include <dashpot/controller/plugin.h>
#include <dashpot/controller/config.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/tests/support/places.hpp>

#include <dlfcn.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::stress {

using controller::JointVector;

/// A robot, where it starts, and which of its joints things happen to.
struct TestArm {
  const char* name;
  const char* file;
  const char* base;
  const char* tip;
  double reflected_inertia;   ///< kg m^2 or kg, each joint: simulated, and known to the controller
  std::vector<double> start;  ///< rad or m, well within the limits
  bool named_only = false;    ///< only in scenarios that name it

  static constexpr int joint = 0;  ///< that is taken out of its limits, slips, ...
  /// The revolute one with the least inertia: before the finger, or the last.
  int light() const { return start.size() == 5 ? 3 : static_cast<int>(start.size()) - 1; }
};

inline const std::vector<TestArm>& test_arms() {
  static const std::vector<double> franka = {0, -0.785, 0, -2.356, 0, 1.571, 0.785},
                                   iiwa = {0, 0.524, 0, -1.396, 0, 1.047, 0},
                                   ur = {0, -1.222, 1.571, -1.920, -1.571, 0},
                                   xarm = {0, -0.3, 0, 0.8, 0, 1.1, 0},
                                   lift = {0.4, 0.5, -1.0, 0.3, 0.02},
                                   gen3 = {0, 0.26, 3.14, -2.27, 0, 0.96, 1.57},
                                   baxter = {0, -0.55, 0, 0.75, 0, 1.26, 0};
  static const std::vector<TestArm> all = {
      {"panda", "panda", "panda_link0", "panda_hand_tcp", 0, franka},
      {"iiwa14", "iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka", 0, iiwa},
      {"iiwa14+rotors", "iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka", 0.1, iiwa},
      {"iiwa7", "iiwa7", "iiwa_link_0", "iiwa_link_ee_kuka", 0, iiwa},
      {"fr3", "fr3", "fr3_link0", "fr3_hand_tcp", 0, franka},
      {"panda+rotors", "panda", "panda_link0", "panda_hand_tcp", 0.1, franka, true},
      {"xarm7", "xarm7", "link_base", "link_eef", 0, xarm},
      {"ur5", "ur5", "base_link", "ee_link", 0, ur},
      {"lift+gripper", "lift_gripper", "base", "fingertip", 0, lift},
      {"ur10e", "ur10e", "base_link", "tool0", 0, ur, true},
      {"gen3", "gen3", "base_link", "end_effector_link", 0, gen3, true},
      {"baxter", "baxter_left", "left_arm_mount", "left_gripper", 0, baxter, true},
  };
  return all;
}

inline JointVector start_of(const TestArm& arm) {
  return Eigen::Map<const Eigen::VectorXd>(arm.start.data(),
                                           static_cast<Eigen::Index>(arm.start.size()));
}

/// A flow list of YAML.
inline std::string yaml_list(const JointVector& values) {
  std::string text = "[";
  for (const double value : values) {
    text += (text.size() > 1 ? ", " : "") +
            (std::isfinite(value) ? std::to_string(value) : std::string("none"));
  }
  return text + "]";
}

/// The lines of a configuration that name the robot.
inline std::string robot_yaml(const TestArm& arm, double told_rotors) {
  const double rotors = arm.reflected_inertia + told_rotors;
  std::string text = "robot:\n  urdf: " + std::string(DASHPOT_SOURCE_DIR "/sim/models/") +
                     arm.file + ".urdf\n  base: " + arm.base + "\n  tip: " + arm.tip + "\n";
  if (rotors > 0) {
    text += "  reflected_inertia: " +
            yaml_list(JointVector::Constant(static_cast<Eigen::Index>(arm.start.size()), rotors)) +
            "\n";
  }
  return text;
}

inline sim::Robot simulated_robot(const TestArm& arm, sim::RobotParameters parameters = {}) {
  if (parameters.reflected_inertia.size() == 0) {
    parameters.reflected_inertia.setConstant(static_cast<Eigen::Index>(arm.start.size()),
                                             arm.reflected_inertia);
  }
  return sim::Robot::from_file(std::string(DASHPOT_SOURCE_DIR "/sim/models/") + arm.file + ".urdf",
                               arm.base, arm.tip, parameters);
}

inline JointVector limits_of(const TestArm& arm, double sim::Joint::*limit) {
  const sim::Robot robot = simulated_robot(arm);
  JointVector values(robot.dof());
  for (int i = 0; i < robot.dof(); ++i)
    values[i] = robot.joints()[static_cast<std::size_t>(i)].*limit;
  return values;
}

/// The functions of a plugin file whose C interface has stayed what it was since version 4.
class PluginFile {
 public:
  PluginFile(std::string label_text, const std::string& path) : label(std::move(label_text)) {
    // Its functions call each other, and not the plugin that the program links with.
    void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
    if (library == nullptr) throw std::runtime_error(dlerror());
    find(library, "dashpot_create", create);
    find(library, "dashpot_destroy", destroy);
    find(library, "dashpot_update", update);
    find(library, "dashpot_reset", reset);
    find(library, "dashpot_set_setpoint", set_setpoint);
    find(library, "dashpot_set_gains", set_gains);
    find(library, "dashpot_last_error", last_error);
    find(library, "dashpot_status_text", status_text);
  }

  std::string label;  ///< "before", "after"
  decltype(&dashpot_create) create = nullptr;
  decltype(&dashpot_destroy) destroy = nullptr;
  decltype(&dashpot_update) update = nullptr;
  decltype(&dashpot_reset) reset = nullptr;
  decltype(&dashpot_set_setpoint) set_setpoint = nullptr;
  decltype(&dashpot_set_gains) set_gains = nullptr;
  decltype(&dashpot_last_error) last_error = nullptr;
  decltype(&dashpot_status_text) status_text = nullptr;

 private:
  template <class Function>
  static void find(void* library, const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(library, name));
    if (function == nullptr) throw std::runtime_error(dlerror());
  }
};

}  // namespace dashpot::stress
