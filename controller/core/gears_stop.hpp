#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Returns the least time constant T, s, of a brake M / T that an arm with elastic joints
/// tolerates: from T on the sampled loop of the brake alone keeps a gain margin of 2 at each of
/// sixteen postures spread over the position limits. The result is at least a fifth of `wanted`, s,
/// the T of the acting brake. It is 0 without elastic joints.
///
/// If the links are measured, the brake takes damping from the modes in which motors swing against
/// links. For one joint with the link's inertia J and the motor's B, it takes all of the damping at
/// T = J B / ((J + B) D_J). If the motors are measured, only their own inertia resists a torque
/// that comes late.
///
/// Throws InvalidSettings with the required T, if that is longer than `wanted`: a slower stop has
/// to be set by the user. Not for the real-time thread: it takes some milliseconds a posture.
double gears_stopping_time(const RobotModel& model, const Settings& settings, double wanted);

}  // namespace dashpot::controller
