#include <dashpot/controller/drives.hpp>
#include <dashpot/text/printable.hpp>

namespace dashpot::controller {
namespace {

constexpr std::array<double, Drives::kMost> kNone{};

constexpr std::array<double, Drives::kMost> all(double value, int joints) {
  std::array<double, Drives::kMost> values{};
  for (int i = 0; i < joints; ++i) values[static_cast<std::size_t>(i)] = value;
  return values;
}

constexpr std::string_view kMenagerieUr =
    "MuJoCo Menagerie, universal_robots_ur5e/ur5e.xml and universal_robots_ur10e/ur10e.xml "
    "(armature)";

constexpr std::array kDrives = {
    Drives{
        "panda", 7, all(0.1, 7), all(1, 7), kNone,
        "MuJoCo Menagerie, franka_emika_panda/panda.xml (armature, damping)",
        "round numbers, the same for all joints; Drake gives the Panda the figures that fr3_drake "
        "has, two to six times as much"},
    Drives{"fr3",
           7,
           {0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074},
           all(0.21, 7),
           {1.137, 1.137, 1.137, 1.137, 0.763, 0.44, 0.248},
           "MuJoCo Menagerie, franka_fr3/fr3.xml (armature, damping, frictionloss)",
           "how they were found is not told; fr3_drake has about three times as much"},
    Drives{
        "fr3_drake",
        7,
        {0.605721456, 0.605721456, 0.462474144, 0.462474144, 0.205544064, 0.205544064, 0.205544064},
        kNone,
        kNone,
        "Drake, manipulation/models/franka_description/README.md: reflected inertia that Franka "
        "states for the FR3",
        "three times those of fr3; the joint's own torque controller hides a part of it"},
    Drives{"iiwa7", 7, all(4.447, 7), kNone, kNone,
           "Drake, manipulation/models/iiwa_description: rotors of 1.737e-4 kg m^2 behind gears of "
           "160, from C. Ott, Cartesian Impedance Control of Redundant and Flexible-Joint Robots, "
           "2008, Table A.2",
           "of the DLR LWR II, and assumed of every joint; the joint's own torque controller hides "
           "most of it from who commands torques"},
    Drives{
        "iiwa14",
        7,
        {3.382, 3.382, 3.382, 3.382, 1.321, 1.162, 1.162},
        kNone,
        kNone,
        "Drake, manipulation/models/iiwa_description/README.md: RoboDrive motors (1.321e-4, "
        "4.54e-5 kg m^2) behind gears of 160, of joint 5 of 100",
        "estimated from the DLR LWR III; the joint's own torque controller hides most of it from "
        "who commands torques"},
    Drives{
        "gen3",
        7,
        {0.015, 0.015, 0.015, 0.015, 0.01928, 0.01928, 0.01928},
        kNone,
        kNone,
        "MuJoCo Menagerie, kinova_gen3_7dof/gen3_7dof.xml: armature of 1.5e-6 and 1.928e-6, which "
        "are rotors, behind gears of 100",
        "the gears are assumed: Kinova states neither (issue 157 of Kinova-kortex2_Gen3_G3L)"},
    Drives{"xarm7",
           7,
           all(0.1, 7),
           {10, 10, 5, 5, 5, 2, 2},
           all(1, 7),
           "MuJoCo Menagerie, ufactory_xarm7/xarm7.xml (armature, damping, frictionloss)",
           "round numbers, the same for all joints; the friction is xarm_ros2's, for a simulator"},
    Drives{
        "ur3e", 6, all(0.1, 6), kNone, kNone, kMenagerieUr,
        "not published for the UR3e, whose joints are smaller than the UR5e's; a round number, the "
        "same for all joints"},
    Drives{
        "ur5e", 6, all(0.1, 6), kNone, kNone, kMenagerieUr,
        "a round number, the same for all joints; the damping there is that of a position servo"},
    Drives{
        "ur10e", 6, all(0.1, 6), kNone, kNone, kMenagerieUr,
        "a round number, the same for all joints; the damping there is that of a position servo"},
    Drives{"ur5", 6, all(0.1, 6), kNone, kNone, kMenagerieUr,
           "of the UR5e; a round number, the same for all joints"},
};

}  // namespace

JointVector Drives::values(const std::array<double, kMost>& all_values) const {
  return Eigen::Map<const Eigen::VectorXd>(all_values.data(), joints);
}

std::span<const Drives> published_drives() noexcept {
  return kDrives;
}

const Drives& find_drives(std::string_view name) {
  std::string names;
  for (const Drives& drives : kDrives) {
    if (drives.name == name) return drives;
    names += (names.empty() ? "" : ", ") + std::string(drives.name);
  }
  throw InvalidModel("'" + text::printable(std::string(name)) + "' is none of " + names);
}

const Drives& find_drives(std::string_view name, int n) {
  const Drives& drives = find_drives(name);
  if (drives.joints == n) return drives;
  throw InvalidModel("drives: those of " + std::string(name) + " have " +
                     std::to_string(drives.joints) + " joints, the arm has " + std::to_string(n));
}

const Drives* drives_like(const RobotModel& model) noexcept {
  const Drives* best = nullptr;
  for (const Drives& drives : kDrives) {
    if (drives.joints != model.dof()) continue;
    for (const std::string_view given :
         {std::string_view(model.name()), std::string_view(model.base()),
          std::string_view(model.joints().front().name)}) {
      const bool begins = given.starts_with(drives.name);
      if (begins && (best == nullptr || drives.name.size() > best->name.size())) best = &drives;
    }
  }
  return best;
}

}  // namespace dashpot::controller
