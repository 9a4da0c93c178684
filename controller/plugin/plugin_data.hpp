#pragma once
// From the C structs of plugin.h to the controller's types and back. Nothing here allocates.

#include <dashpot/controller/plugin.h>
#include <dashpot/analysis/system.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/snapshot.hpp>

namespace dashpot::controller {

/// Returns the fields of `given`, or, if it is missing or does not have n joints, a state without
/// entries at `time`.
RobotState to_state(const dashpot_state* given, int n, std::int64_t time) noexcept;

/// Sets all of `setpoint` but its gains, or returns the negative code that says why not, and leaves
/// it as it is. DASHPOT_ON_ARRIVAL becomes `now`. Does not check whether the numbers are possible.
std::int32_t to_setpoint(const dashpot_setpoint* given, int n, std::int64_t now,
                         Setpoint& setpoint) noexcept;

/// Sets the given members of `gains`, or returns the negative code that says why not. Does not
/// check whether the numbers are possible.
std::int32_t to_gains(const dashpot_gains* given, int n, Gains& gains) noexcept;

void to_c(const DynamicsResult& dynamics, dashpot_dynamics& out) noexcept;
void to_c(const analysis::System<kMaxJoints>& system, dashpot_closed_loop& out) noexcept;
void to_c(const Snapshot& snapshot, dashpot_snapshot& out) noexcept;
void to_c(const Vibration& vibration, dashpot_modes& out) noexcept;
void to_c(const SampledVibration& vibration, dashpot_sampled_modes& out) noexcept;

}  // namespace dashpot::controller
