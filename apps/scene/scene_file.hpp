#pragma once
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/apps/scene/scene.hpp>

#include <string>

namespace dashpot::apps {

/// Reads a YAML file: a configuration file of the controller (load_config) with three keys more,
/// `commands`, `simulation` and `scenario`. sim/scenes/panda.yaml has all keys. Throws InputError.
Scene load_scene(const std::string& path);

/// Returns the parameters of a simulation of the robot that a controller knows.
sim::RobotParameters believed(const controller::RobotDescription& robot,
                              const controller::RobotModel& model);

/// A configuration of the controller, and the limits of commands over a bus: all that a loop with a
/// robot needs.
struct CommandedConfig {
  controller::Config config;
  lcmtypes::CommandLimits commands;
};
/// Reads it from a configuration file or a scene, whose other keys are ignored. Throws InputError.
CommandedConfig load_commanded_config(const std::string& path);

/// Returns the posture of --q, else the start of the configuration's scenario, else the usual one.
/// Throws InputError.
JointVector posture_of(const std::string& config, const PostureOption& option,
                       const controller::RobotModel& model);

}  // namespace dashpot::apps
