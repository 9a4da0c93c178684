#pragma once
#include <dashpot/controller/plugin.h>
#include <dashpot/lcmtypes/samples.hpp>

namespace dashpot::lcmtypes {

/// The plugin's structs as what the publisher takes. Nothing here allocates.
void fill(const dashpot_snapshot& from, controller::Snapshot& to) noexcept;
void fill(const dashpot_modes& from, ModesSample& to) noexcept;
void fill(const dashpot_sampled_modes& from, SampledModesSample& to) noexcept;

}  // namespace dashpot::lcmtypes
