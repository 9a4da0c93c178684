#pragma once
// Robots for the tests of the simulator: the four arms, and chains made up from a seed.

#include <dashpot/sim/robot.hpp>
#include <dashpot/tests/support/random.hpp>

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

inline std::string triple(const Eigen::Vector3d& v) {
  std::ostringstream text;
  text.precision(17);
  text << v.x() << " " << v.y() << " " << v.z();
  return text.str();
}

inline std::string origin_element(const Eigen::Vector3d& xyz, const Eigen::Vector3d& rpy) {
  return "<origin xyz='" + triple(xyz) + "' rpy='" + triple(rpy) + "'/>";
}

/// <inertial> with principal moments turned by a random angle.
inline std::string random_inertial(Random& random) {
  const Eigen::Vector3d com = 0.1 * random.vector(3);
  std::ostringstream text;
  text.precision(17);
  const double a = random.log_uniform(1e-3, 1e-1), b = random.uniform(0.5, 1) * a;
  const double c = random.uniform(a - b, a + b);
  text << "<inertial>" << origin_element(com, random.vector(3)) << "<mass value='"
       << random.log_uniform(0.1, 10) << "'/><inertia ixx='" << a << "' iyy='" << b << "' izz='"
       << c << "' ixy='0' ixz='0' iyz='0'/></inertial>";
  return text.str();
}

/// n moving joints of random type, axis and place, some fixed joints between them.
inline ChainFile random_chain(Random& random, int n) {
  std::ostringstream text;
  text << "<robot name='random'><link name='link0'/>";
  int link = 0;
  for (int moving = 0; moving < n;) {
    const int kind = random.integer(0, 3);
    const char* const type = kind == 0   ? "fixed"
                             : kind == 1 ? "prismatic"
                             : kind == 2 ? "continuous"
                                         : "revolute";
    if (kind != 0) ++moving;
    text << "<joint name='joint" << link + 1 << "' type='" << type << "'><parent link='link" << link
         << "'/><child link='link" << link + 1 << "'/>"
         << origin_element(0.4 * random.vector(3), 2 * random.vector(3)) << "<axis xyz='"
         << triple(random.vector(3)) << "'/>"
         << "<limit lower='-2' upper='2' effort='50' velocity='3'/></joint>";
    ++link;
    text << "<link name='link" << link << "'>" << random_inertial(random) << "</link>";
  }
  text << "</robot>";
  return {"random" + std::to_string(n), text.str(), "link0", "link" + std::to_string(link)};
}

}  // namespace dashpot::testing
