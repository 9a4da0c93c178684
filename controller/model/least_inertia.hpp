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

/// Returns the arm without payload, whose inertia is least, or, where that lacks inertia, the arm
/// as it is.
RobotModel unloaded(const RobotModel& model);

/// Returns inertias I (n, kg m^2) that the joints have independently of each other: M - diag(I) is
/// positive semidefinite at 1024 postures spread evenly between the position limits. I is a common
/// fraction of the least 1 / (M^-1)_ii, what joint i resists with while all others are free.
///
/// Dampers c_i = g I_i on any number of joints at once have eigenvalues of at most g in M^-1 C, so
/// a bound of the sampled loop for one joint of inertia I_i serves them all.
JointVector least_joint_inertia(const RobotModel& model, const JointVector& lower,
                                const JointVector& upper);

}  // namespace dashpot::controller
