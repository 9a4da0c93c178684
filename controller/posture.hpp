#pragma once
#include <dashpot/controller/robot_model.hpp>

#include <string>

namespace dashpot::controller {

/// The posture that stands for an arm where none is given: the middle of each joint's position
/// limits, and 0 where a joint has none.
JointVector middle_posture(const RobotModel& model);

/// One line that names the first joint more than `tolerance` (rad or m) outside its position
/// limits, and says so if degrees fit where q (n, rad) does not; empty if q is inside.
std::string outside_limits(const RobotModel& model, const JointVector& q, double tolerance = 1e-3);

}  // namespace dashpot::controller
