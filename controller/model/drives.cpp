#include <dashpot/controller/drives.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/text/printable.hpp>
#include <dashpot/text/quantity.hpp>
#include <dashpot/text/setting_reader.hpp>

#include <algorithm>
#include <map>
#include <mutex>

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
           "their origin is not stated; fr3_drake has about three times as much"},
    Drives{
        "fr3_drake",
        7,
        {0.605721456, 0.605721456, 0.462474144, 0.462474144, 0.205544064, 0.205544064, 0.205544064},
        kNone,
        kNone,
        "Drake, manipulation/models/franka_description/README.md: reflected inertia that Franka "
        "states for the FR3",
        "three times the values of fr3; the joint's own torque controller hides a part of it"},
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
        "not confirmed by a record, and not published for the UR3e, whose joints are smaller than "
        "the UR5e's; a round number, which is contradicted on the UR10e: see there"},
    Drives{"ur5e", 6, all(0.1, 6), kNone, kNone, kMenagerieUr,
           "not confirmed by a record; a round number, which is contradicted on the UR10e: see "
           "there; the damping there belongs to a position servo"},
    Drives{"ur10e", 6, all(0.1, 6), kNone, kNone, kMenagerieUr,
           "not confirmed by a record: a round number, which a public record contradicts "
           "(shamilmamedov/dynamic_calibration), with 0.30 to 0.42 kg m^2 in the wrists, 1.4 to "
           "3.4 in the first three joints"},
    Drives{"ur5", 6, all(0.1, 6), kNone, kNone, kMenagerieUr,
           "not confirmed by a record; of the UR5e, and a round number, which is contradicted on "
           "the UR10e: see there"},
};

struct FileDrives {
  std::string name, source = "not stated", doubt = "not stated";
  Drives drives{};
};

bool has_unit(const std::string& quantity, const char* unit) try {
  text::parse_quantity(quantity, unit);
  return true;
} catch (const std::invalid_argument&) {
  return false;
}

/// Reads figures in the unit of revolute joints, or, where it is written, of prismatic ones.
void read_figures(const text::YamlMapping& keys, std::string_view key, const char* turns,
                  const char* slides, int joints, std::array<double, Drives::kMost>& figures) {
  const text::YamlNode* const list = keys.find(key);
  if (list == nullptr) return;
  text::Units units(static_cast<std::size_t>(joints), turns);
  for (std::size_t i = 0; i < std::min(units.size(), list->items.size()); ++i) {
    const std::string& written = list->items[i].text;
    if (!has_unit(written, turns) && has_unit(written, slides)) units[i] = slides;
  }
  Eigen::VectorXd values(joints);
  read_numbers(keys, key, units, text::kNotNegative, values);
  for (int i = 0; i < joints; ++i) figures[static_cast<std::size_t>(i)] = values[i];
}

void read_drives(const std::string& text, FileDrives& file) {
  static constexpr auto kKeys = text::key_list("reflected_inertia", "viscous_friction",
                                               "coulomb_friction", "source", "doubt");
  const text::YamlNode document = text::parse_yaml(text);
  const text::YamlMapping keys(document, "", kKeys);
  const text::YamlNode* const list = keys.find("reflected_inertia");
  if (list == nullptr) throw keys.error("reflected_inertia", "missing");
  const std::size_t joints = list->items.size();
  if (list->kind != text::YamlNode::Kind::kSequence || joints < 1 || joints > Drives::kMost) {
    throw keys.error("reflected_inertia", "needs a list of a number for each joint, kg m^2");
  }
  Drives& drives = file.drives;
  drives.joints = static_cast<int>(joints);
  read_figures(keys, "reflected_inertia", "kg m^2", "kg", drives.joints, drives.reflected_inertia);
  read_figures(keys, "viscous_friction", "N m s/rad", "N s/m", drives.joints,
               drives.viscous_friction);
  read_figures(keys, "coulomb_friction", "N m", "N", drives.joints, drives.coulomb_friction);
  if (keys.has("source")) read_text(keys, "source", file.source);
  if (keys.has("doubt")) read_text(keys, "doubt", file.doubt);
  drives.name = file.name;
  drives.source = file.source;
  drives.doubt = file.doubt;
}

/// Returns the drives of a file, which stay as long as the program runs.
const Drives& drives_of_file(const std::string& path) try {
  static std::mutex mutex;
  static std::map<std::string, FileDrives> known;  // by path and text
  const std::string text = text::read_regular_file(path);
  const std::lock_guard<std::mutex> lock(mutex);
  const auto [at, is_new] = known.try_emplace(path + '\n' + text);
  if (is_new) try {
      at->second.name = path;
      read_drives(text, at->second);
    } catch (...) {
      known.erase(at);
      throw;
    }
  return at->second.drives;
} catch (const InputError& error) {
  const std::string what = error.what();
  throw InvalidModel(what.starts_with(path) ? what : path + ": " + what);
}

}  // namespace

bool is_drives_file(std::string_view name) noexcept {
  return name.ends_with(".yaml") || name.ends_with(".yml");
}

std::string drives_name(std::string_view name, const std::filesystem::path& directory) {
  return is_drives_file(name) ? (directory / name).lexically_normal().string() : std::string(name);
}

JointVector Drives::values(const std::array<double, kMost>& all_values) const {
  return Eigen::Map<const Eigen::VectorXd>(all_values.data(), joints);
}

bool has_own_friction(std::string_view name) {
  if (!is_drives_file(name)) return false;
  const Drives& drives = find_drives(name);
  return !drives.values(drives.viscous_friction).isZero(0) ||
         !drives.values(drives.coulomb_friction).isZero(0);
}

std::span<const Drives> published_drives() noexcept {
  return kDrives;
}

const Drives& find_drives(std::string_view name) {
  if (is_drives_file(name)) return drives_of_file(std::string(name));
  std::string names;
  for (const Drives& drives : kDrives) {
    if (drives.name == name) return drives;
    names += (names.empty() ? "" : ", ") + std::string(drives.name);
  }
  throw InvalidModel("'" + text::printable(std::string(name)) + "' is not one of " + names +
                     ", and not a drives file (.yaml)");
}

const Drives& find_drives(std::string_view name, int n) {
  const Drives& drives = find_drives(name);
  if (drives.joints == n) return drives;
  throw InvalidModel("drives: " + std::string(name) + " has " + std::to_string(drives.joints) +
                     " joints, the arm has " + std::to_string(n));
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
