#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Returns settings that suit a robot.
///
/// The limits of torque, velocity and position come from the URDF; where the URDF has none they are
/// 100 N m, 2 rad/s and no position limit. If no joint of an arm of four or more has a limit of
/// effort, limits.torque is 0, which `validate` refuses, so that it must be set. Torque changes by
/// at most 1000 N m/s, or, if that is slower and for prismatic joints, by the whole torque limit in
/// 10 ms. The margin before a position limit is a tenth of the range, at most 0.1 rad or 2 cm. A
/// joint outside its limits returns with 0.05 rad/s or 1 cm/s. The reference moves at a quarter of
/// the velocity limits. It accelerates so that it has the velocity limit after a second, or slower
/// where the URDF's limits of acceleration, deceleration and jerk require that.
///
/// Stiffness suits the robot's inertia: 1.5 Hz for each joint alone in the middle of its range; at
/// the tip 400 N/m and 20 N m/rad, or less where a mode with it would decay too fast for a loop of
/// 1 kHz at any posture, also without the payload; in the null space a quarter of the joints'.
/// Damping is designed at every tick so that modes have a ratio of 0.7, wherever the arm is.
/// Dampers for motions whose springs are taken away are given as well: 40 N s/m and 2 N m s/rad at
/// the tip, or less if that would be too fast; in each joint the damper of a ratio of 0.7 at 1.5
/// Hz, and in the null space half of it.
Settings default_settings(const RobotModel& model);

/// Returns true for an arm, of four joints or more, none of which has a limit of effort.
bool lacks_efforts(const RobotModel& model);

}  // namespace dashpot::controller
