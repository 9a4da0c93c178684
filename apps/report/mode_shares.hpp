#pragma once
#include <dashpot/analysis/response.hpp>
#include <dashpot/apps/report/json.hpp>

#include <string>

namespace dashpot::apps {

/// Returns a table of the modes with their shares in a motion and the amplitudes of `point`, and of
/// the other shares.
std::string shares_table(const analysis::Spectrum<>& spectrum, const analysis::ModeShares& shares,
                         const std::string& point);

/// Returns energy, zero_modes, cross, and amplitude: a list for each mode.
Json shares_json(const analysis::ModeShares& shares);

}  // namespace dashpot::apps
