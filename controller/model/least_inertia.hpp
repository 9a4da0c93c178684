#pragma once
#include <dashpot/controller/robot_model.hpp>

namespace dashpot::controller {

/// Inertia of the tip in the direction in which it is least.
struct TipInertia {
  double linear;   ///< kg
  double angular;  ///< kg m^2
};

/// Returns the least inertia of the tip over 64 postures spread evenly between the position limits
/// (n, rad; half a turn where there is none).
TipInertia least_tip_inertia(const RobotModel& model, const JointVector& lower,
                             const JointVector& upper);

/// Returns the arm without payload, whose inertia is least, or the arm as it is, if it lacks
/// inertia without its payload.
RobotModel unloaded(const RobotModel& model);

}  // namespace dashpot::controller
