#pragma once
#include <dashpot/apps/identify/identify_writer.hpp>

#include <string>

namespace dashpot::apps {

/// Draws how the poles of the first posture's models settle as their order rises, and the measured
/// modes with their 95 % intervals beside the predicted ones. Throws std::runtime_error if gnuplot
/// is missing or fails.
void draw_identification(const std::string& path, const IdentifyReport& report);

}  // namespace dashpot::apps
