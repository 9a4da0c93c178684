#pragma once
#include <dashpot/analysis/gears.hpp>
#include <dashpot/controller/robot_model.hpp>

namespace dashpot::controller {

using analysis::PassivePart;

/// Returns the gears of a model for the analysis; without elastic joints they are empty.
analysis::Gears elastic_joints(const RobotModel& model);

}  // namespace dashpot::controller
