#pragma once
#include <dashpot/apps/report/system_report.hpp>

#include <string>

namespace dashpot::apps {

/// Draws the eigenvalues of a system in the complex plane, with lines of equal damping ratio, and
/// its mode shapes as bars, to `path`. Throws InputError if there are no modes, and
/// std::runtime_error if gnuplot is missing or fails.
void draw_modes(const std::string& path, const std::string& title, const Report& report);

}  // namespace dashpot::apps
