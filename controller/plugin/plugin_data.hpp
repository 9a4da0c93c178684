#pragma once
// From the C structs of plugin.h to the controller's types and back. Nothing here allocates.

#include <dashpot/controller/plugin.h>
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/snapshot.hpp>

namespace dashpot::controller {

/// The fields of `given`, or a state without entries if it is missing or is not one of n joints;
/// its time is then `time`.
RobotState to_state(const dashpot_state* given, int n, std::int64_t time) noexcept;

/// Sets all of `setpoint` but its gains, or returns the negative code that says why not, and leaves
/// it as it is. DASHPOT_ON_ARRIVAL becomes `now`. That numbers are possible is not checked.
std::int32_t to_setpoint(const dashpot_setpoint* given, int n, std::int64_t now,
                         Setpoint& setpoint) noexcept;

/// Sets those of `gains` that are given, or returns the negative code that says why not. That the
/// numbers are possible is not checked.
std::int32_t to_gains(const dashpot_gains* given, int n, Gains& gains) noexcept;

void to_c(const DynamicsResult& dynamics, dashpot_dynamics& out) noexcept;
void to_c(const analysis::System<kMaxJoints>& system, dashpot_closed_loop& out) noexcept;
void to_c(const Snapshot& snapshot, dashpot_snapshot& out) noexcept;
void to_c(const Vibration& vibration, dashpot_modes& out) noexcept;
void to_c(const SampledVibration& vibration, dashpot_sampled_modes& out) noexcept;

}  // namespace dashpot::controller
