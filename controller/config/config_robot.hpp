#pragma once
// The part of a configuration file under the key `robot`.

#include <dashpot/controller/robot_description.hpp>
#include <dashpot/controller/yaml/setting_reader.hpp>

#include <filesystem>

namespace dashpot::controller {

/// The robot that `robot` describes; model() of it does not throw. A relative path of its URDF
/// begins at `directory`, unless its `text` is known. Throws InputError.
RobotDescription read_robot(const YamlMapping& root, const std::filesystem::path& directory,
                            const std::string& text = "");

/// Sets the options of payload, rotors, friction and gears under `keys`, of the joints of `model`.
/// Throws InputError.
void read_joint_options(const YamlMapping& keys, const RobotModel& model, ModelOptions& options);

/// The unit of a quantity of each joint: `revolute`, or `prismatic` for prismatic joints.
Units joint_units(const RobotModel& model, const char* revolute, const char* prismatic);

}  // namespace dashpot::controller
