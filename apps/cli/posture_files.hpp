#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <string>
#include <vector>

namespace dashpot::apps {

/// Returns the postures in a YAML file: a list of lists of n joint positions, rad or m. Throws
/// InputError that names the file and the entry.
std::vector<controller::JointVector> read_postures(const std::string& path, int n);

/// Returns measured postures of the DASHPOT_STATE messages of an LCM log: the first one, and then
/// each in which a joint is further than `step` (rad or m) from the one before it in the result.
/// Malformed messages are left out, and so are positions that are not finite. Throws InputError for
/// a log with another number of joints or without states, and std::runtime_error for a file that
/// cannot be opened.
std::vector<controller::JointVector> read_log_postures(const std::string& path, int n, double step);

}  // namespace dashpot::apps
