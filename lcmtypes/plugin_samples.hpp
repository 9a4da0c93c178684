#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/lcmtypes/samples.hpp>

namespace dashpot::lcmtypes {

/// Converts the plugin's structs to the publisher's. Nothing here allocates.
void fill(const dashpot_snapshot& from, controller::Snapshot& to) noexcept;
void fill(const dashpot_modes& from, ModesSample& to) noexcept;
void fill(const dashpot_sampled_modes& from, SampledModesSample& to) noexcept;

}  // namespace dashpot::lcmtypes
