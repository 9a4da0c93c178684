#pragma once
#include <dashpot/apps/records/recorded_motion.hpp>

#include <string>

namespace dashpot::apps {

/// Reads an LCM log with DASHPOT_STATE messages (channels q1 ..., v1 ..., tau1 ... and wrench_x
/// ...), or a CSV file: a line of names with units ("q1 [rad]", "q1 (deg)", "q1_deg"; without a
/// unit q is in rad, qd, dq and v in rad/s, tau and torque in N m, time in s, utime in us), then
/// numbers between commas, semicolons (with decimal commas, too), tabs or spaces. The names may be
/// in a comment, as numpy.savetxt writes them, or in `hints`. An empty cell or nan is a sample that
/// is missing, as is NA or null; columns that begin with text are left out, and text further down
/// is a `problem` of its channel. One column is the time: t, time, timestamp, stamp, date, utime,
/// duration or elapsed, in numbers or as 2026-01-31T12:00:00.5Z; where no
/// unit is given and its steps exceed half a second, it is in ms, us or ns. Of a file without names
/// a first column that rises evenly is the time. Throws InputError that names the file, the line
/// and the column.
MotionFile read_motion_file(const std::string& path, const FileHints& hints = {});

/// Numbers of the channels called `names`, "q1,q2"; of those that are positions, or else
/// velocities, if that is empty, without those that are desired ("q_d_0", "pos_cmd"), in `others`,
/// or the tip's beside joints; of a file without names all. No two of one name. Throws InputError
/// with `option` as key.
std::vector<Eigen::Index> chosen_channels(const std::vector<MotionChannel>& channels,
                                          const std::string& names,
                                          const std::vector<Eigen::Index>& others = {},
                                          const std::string& option = "--channels");

/// Says which positions chosen_channels left out by itself, and why.
std::vector<std::string> left_out_positions(const std::vector<MotionChannel>& channels,
                                            const std::vector<Eigen::Index>& chosen,
                                            const std::vector<Eigen::Index>& others);

}  // namespace dashpot::apps
