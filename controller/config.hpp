#pragma once
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/text/setting_reader.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace dashpot::controller {

/// Sections of a configuration file. What stands under the last three is for the program that runs
/// the controller.
inline constexpr auto kConfigSections =
    text::key_list("robot", "control", "environment", "gains", "limits", "motion", "feed_forward",
                   "integral", "watchdog", "analysis", "commands", "simulation", "scenario");

/// Contents of a configuration file. controller/examples/panda.yaml has all keys with their units
/// and defaults.
struct Config {
  RobotDescription robot;
  RobotModel model;
  Settings settings;
  std::vector<std::string> notes = {};  ///< what stands in the file and does nothing, a line each
};

/// Reads a configuration from a YAML file. The path of the URDF in it is relative to the directory
/// of the YAML file. The keys `commands`, `simulation` and `scenario` are ignored, because they are
/// for `dashpot run`. Throws InputError, which names file, key and line, for an unknown, duplicate
/// or missing key, a wrong unit, size or sign, a number that is not finite, gains that are not
/// symmetric positive semidefinite, and any error in the URDF.
Config load_config(const std::string& path);
/// Reads a configuration from a parsed YAML file, as load_config does. A relative path of the URDF
/// begins at `directory`. Errors do not name the file.
Config read_config(const text::YamlNode& document, const std::filesystem::path& directory);

/// The robot that `robot` describes; model() of it does not throw. A relative path of its URDF
/// begins at `directory`, unless its `text` is known. Throws InputError.
RobotDescription read_robot(const text::YamlMapping& root, const std::filesystem::path& directory,
                            const std::string& text = "");

/// Sets the options of payload, rotors, friction and gears under `keys`, of the joints of `model`.
/// Throws InputError.
void read_joint_options(const text::YamlMapping& keys, const RobotModel& model,
                        ModelOptions& options);

/// Returns the unit of a quantity of each joint: `revolute`, or `prismatic` for prismatic joints.
text::Units joint_units(const RobotModel& model, const char* revolute, const char* prismatic);

/// Whether stiffness and damping may be given one without the other.
enum class GainPairs { kTogether, kEither };

/// Sets the members of `gains` that the key `gains` of `parent` contains. Does not check whether
/// the matrices are possible. Throws InputError.
void read_gains(const text::YamlMapping& parent, const RobotModel& model, GainPairs pairs,
                Gains& gains);

/// Sets the projector and its weights that stand under `control`. Throws InputError.
void read_null_projector(const text::YamlMapping& root, const RobotModel& model,
                         NullProjector& projector, JointVector& weights);

/// Returns the gains under the key `gains` of `parent`, one without the other. What is missing is
/// zero. Throws InputError.
Gains read_gains(const text::YamlMapping& parent, const RobotModel& model);

}  // namespace dashpot::controller
