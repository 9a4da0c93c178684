#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <cstdint>

namespace dashpot::lcmtypes {

/// Limits of what a command may ask for. Position limits are the robot's; the other defaults are
/// wide enough for any arm of human size.
struct CommandLimits {
  controller::JointVector position_lower;  ///< n, rad
  controller::JointVector position_upper;  ///< n, rad
  double reach = 3;                        ///< distance of the tip from the base link's origin, m
  double force = 200;                      ///< each entry of the wrench, N
  double torque = 50;                      ///< N m
  double joint_stiffness = 20000;          ///< each entry, also in the null space, N m/rad
  double joint_damping = 2000;             ///< N m s/rad
  double task_stiffness = 50000;           ///< each entry, N/m, N/rad, N m/rad
  double task_damping = 5000;              ///< N s/m, N s/rad, N m s/rad
  double damping_ratio = controller::kLargestDampingRatio;
  double payload = 20;               ///< mass, kg
  double payload_distance = 1;       ///< of its centre from the tip link's origin, m
  double tool_distance = 1;          ///< of T's origin from the tip link's, m
  double linear_velocity = 10;       ///< of the tip's reference, m/s; hosts set the robot's
  double angular_velocity = 100;     ///< likewise, rad/s
  double tip_velocity = 10;          ///< limit of the tip's speed, m/s; likewise
  std::int64_t oldest = 500'000;     ///< largest age of a command when it arrives, us
  std::int64_t furthest = 100'000;   ///< its time may be this far ahead of the receiver's, us
  std::int64_t silence = 1'000'000;  ///< a sender silent for longer no longer commands, us
  double most_per_second = 2000;     ///< commands a second with gains, a payload or a tool, which
                                     ///< have to be judged; more are refused
  double burst = 50;                 ///< number of these that may come at once
};

}  // namespace dashpot::lcmtypes
