#pragma once
#include <string>

namespace dashpot::apps {

/// Returns text between single quotes for gnuplot.
std::string quoted_for_gnuplot(const std::string& text);

/// Throws InputError unless the path that the user gave with `--plot` ends with .svg or .png and
/// its folder exists.
void check_plot_name(const std::string& path);

/// The first lines of a gnuplot script that draws to `path`, `width` x `height` pixels.
std::string plot_heading(const std::string& path, int width, int height);

/// Draws a script that begins with plot_heading. Throws std::runtime_error if gnuplot is missing or
/// fails.
void run_gnuplot(const std::string& path, const std::string& script);

}  // namespace dashpot::apps
