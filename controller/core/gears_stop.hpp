#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>

namespace dashpot::controller {

/// Returns the time constant T, s, of a brake M / T from which on an arm with gears that bend bears
/// it: the sampled loop of that brake alone keeps a gain margin of 2 at each of sixteen postures
/// spread over the position limits. Below a fifth of `wanted`, s, the T of the brake that acts, the
/// result is that fifth. An arm without such gears bears any, 0.
///
/// Where the links are measured, the brake takes damping from the modes in which motors swing
/// against links. Of one joint with the link's inertia J and the motor's B, it takes all of it at
/// T = J B / ((J + B) D_J). Where the motors are measured, these have only their own inertia to
/// answer a torque with that comes late.
///
/// Throws InvalidSettings with the T that is needed, if that is longer than `wanted`: a stop that
/// takes longer is to be asked for. Not for the real-time thread: it takes some milliseconds a
/// posture.
double gears_stopping_time(const RobotModel& model, const Settings& settings, double wanted);

}  // namespace dashpot::controller
