#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Settings for a robot. Limits of torque, velocity and position are those of its URDF (100 N m,
/// 2 rad/s and none where the URDF has none), torque changes by at most 1000 N m/s (fully within 10
/// ms where that is slower, and for prismatic joints), the margin before a position limit is a
/// tenth of the range, at most 0.1 rad or 2 cm, a joint returns with 0.05 rad/s or 1 cm/s,
/// set-points move at a quarter of the velocity limits. Gains suit the robot's inertia: 1.5 Hz and
/// a damping ratio of 0.7 for each joint alone in the middle of its range, and 2 N m s/rad, 40 N
/// s/m at the tip, or less where its inertia is too small for that anywhere, with stiffness 10/s
/// times that.
Settings default_settings(const RobotModel& model);

}  // namespace dashpot::controller
