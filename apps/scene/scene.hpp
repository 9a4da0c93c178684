#pragma once
// A scene of `dashpot run`: a robot with its controller, how it is simulated, and what happens.
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>

#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

using controller::InputError;
using controller::JointVector;

/// A controlled robot arm.
struct ControlledArm {
  controller::Config config;
  sim::Robot robot;
  sim::ArmOptions options;
};

/// From this time on the controller is given this set-point.
struct ScenarioStep {
  double at = 0;  ///< s
  int line = 0;   ///< of the file
  controller::Setpoint setpoint;
  std::optional<controller::Payload> payload;  ///< for the controller at this step
};

/// From `begin` until just before `end`, s, the controller is called in some periods only.
struct LoopFault {
  double begin = 0;
  double end = 0;
  int every = 1;         ///< called every so many periods; 0: never
  JointVector moved_by;  ///< n, rad: a hand moves the robot by this meanwhile; zero: it is held
                         ///< where it is; empty: the last torque acts on
};

/// Joint vectors have n entries.
struct Scene {
  std::string path;
  std::optional<ControlledArm> arm;  ///< there is one once the scene is loaded
  double duration = 5;               ///< s
  bool ring_down = false;            ///< fit the modes of small releases, too
  sim::PlantOptions plant;
  lcmtypes::CommandLimits commands;    ///< what the arm may be commanded over a bus
  std::vector<LoopFault> loop_faults;  ///< of overlapping ones the first counts
  bool outside_limits = false;         ///< the arm may start outside its position limits
  JointVector rest;                    ///< where the springs are fixed at first, rad
  JointVector start;                   ///< where the robot is let go, rad
  JointVector velocity;                ///< with this velocity, rad/s
  std::vector<ScenarioStep> steps;     ///< by time; the first one at 0

  int dof() const { return static_cast<int>(rest.size()); }
};

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
