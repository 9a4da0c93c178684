#pragma once
#include <dashpot/controller/robot_description.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/yaml/yaml_document.hpp>

#include <filesystem>
#include <string>

namespace dashpot::controller {

/// What a configuration file says. Its keys, with units and defaults, stand in
/// controller/examples/panda.yaml.
struct Config {
  RobotDescription robot;
  RobotModel model;
  Settings settings;
};

/// Reads a YAML file. The path of the URDF in it is relative to the file's directory. The keys
/// `commands`, `simulation` and `scenario` are left alone: they are for `dashpot run`. Throws
/// InputError, which names file, key and line, for an unknown, duplicate or missing key, a wrong
/// unit, size or sign, a number that is not finite, gains that are not symmetric positive
/// semidefinite, and whatever is wrong with the URDF.
Config load_config(const std::string& path);
/// Likewise for a file that is parsed already. A relative path of the URDF begins at `directory`;
/// errors do not name the file.
Config read_config(const YamlNode& document, const std::filesystem::path& directory);

}  // namespace dashpot::controller
