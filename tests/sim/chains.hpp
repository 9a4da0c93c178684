#pragma once
// Robots for the tests of the simulator: the four arms, and chains made up from a seed.

#include <dashpot/sim/robot.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace dashpot::testing {

struct ChainFile {
  std::string name, urdf, base, tip;
  friend std::ostream& operator<<(std::ostream& stream, const ChainFile& file) {
    return stream << file.name;
  }
};

inline ChainFile arm_file(const std::string& name, const std::string& base,
                          const std::string& tip) {
  std::ifstream stream(DASHPOT_SOURCE_DIR "/sim/models/" + name + ".urdf");
  std::ostringstream text;
  text << stream.rdbuf();
  return {name, text.str(), base, tip};
}

inline ChainFile panda_file() {
  return arm_file("panda", "panda_link0", "panda_hand_tcp");
}

inline std::vector<ChainFile> arm_files() {
  return {panda_file(), arm_file("iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka"),
          arm_file("ur5", "base_link", "ee_link"),
          arm_file("baxter_left", "left_arm_mount", "left_gripper")};
}

inline sim::Robot robot_of(const ChainFile& file, const sim::RobotParameters& parameters = {}) {
  return sim::Robot::from_text(file.urdf, file.base, file.tip, parameters, file.name);
}

/// n moving joints of random type, axis and place, then a fixed joint.
inline ChainFile random_chain(Random& random, int n) {
  return {"random" + std::to_string(n), RandomRobot(random.engine()()).chain(n, 0.3), "link0",
          "tip"};
}

}  // namespace dashpot::testing
