#pragma once
#include <dashpot/apps/records/recorded_motion.hpp>

#include <string>

namespace dashpot::apps {

/// Reads an LCM log with DASHPOT_STATE messages (channels q1 ..., v1 ..., tau1 ... and wrench_x
/// ...), or a CSV file: a line of names with units ("q1 [rad]", "q1 (deg)", "q1_deg"; without a
/// unit q is in rad, qd, dq and v in rad/s, tau and torque in N m, time in s, utime in us), then
/// numbers between commas, semicolons (with decimal commas, too), tabs or spaces. The names may be
/// in a comment, as numpy.savetxt writes them, or in `hints`. An empty cell, nan, NA or null is a
/// missing sample; columns that begin with text are left out, and text further down is a `problem`
/// of its channel. One column is the time: t, time, timestamp, stamp, date, utime, duration or
/// elapsed, in numbers or as 2026-01-31T12:00:00.5Z; without a unit, and with steps over half a
/// second, it is in ms, us or ns. In a file without names a first column that rises evenly is the
/// time. Throws InputError with the file, the line and the column.
MotionFile read_motion_file(const std::string& path, const FileHints& hints = {});

/// Indices of the channels `names`, "q1,q2". If that is empty: of all positions, or otherwise
/// velocities, except desired ones ("q_d_0", "pos_cmd"), channels in `others`, and the tip's if
/// there are joints; of all channels without names. No two have one name. Throws InputError with
/// `option` as key.
std::vector<Eigen::Index> chosen_channels(const std::vector<MotionChannel>& channels,
                                          const std::string& names,
                                          const std::vector<Eigen::Index>& others = {},
                                          const std::string& option = "--channels");

/// Says which positions chosen_channels left out by itself, and why.
std::vector<std::string> left_out_positions(const std::vector<MotionChannel>& channels,
                                            const std::vector<Eigen::Index>& chosen,
                                            const std::vector<Eigen::Index>& others);

}  // namespace dashpot::apps
