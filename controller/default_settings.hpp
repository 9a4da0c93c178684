#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Returns settings that suit a robot.
///
/// The limits of torque, velocity and position come from the URDF; where the URDF has none they are
/// 100 N m, 2 rad/s and no position limit. Torque changes by at most 1000 N m/s, or, if that is
/// slower and for prismatic joints, by the whole torque limit in 10 ms. The margin before a
/// position limit is a tenth of the range, at most 0.1 rad or 2 cm. A joint outside its limits
/// returns with 0.05 rad/s or 1 cm/s. The reference moves at a quarter of the velocity limits.
///
/// Gains suit the robot's inertia: 1.5 Hz and a damping ratio of 0.7 for each joint alone in the
/// middle of its range. At the tip damping is 2 N m s/rad and 40 N s/m, or less if the tip's
/// inertia is too small for this anywhere; stiffness is 10/s times the damping.
Settings default_settings(const RobotModel& model);

}  // namespace dashpot::controller
