#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

namespace dashpot::apps {

/// One channel of a recorded motion.
struct MotionChannel {
  std::string name;
  std::string unit;  ///< SI: rad, m, rad/s, m/s, N m, N; empty if the file does not say
};

/// A recorded motion.
struct MotionFile {
  std::vector<MotionChannel> channels;
  Eigen::VectorXd time;    ///< s, strictly rising, from the first sample
  Eigen::MatrixXd values;  ///< channels x samples, SI; NaN where a sample is missing
  /// For each sample whether the controller was well and kept its reference and its wrench; empty
  /// for CSV files.
  std::vector<bool> free;
  std::vector<bool> rests;  ///< the same, whatever the wrench does
  /// Of a log whose springs are at the joints throughout: the tip's wrench is that of an excitation
  /// alone, and in channels wrench_x ... wrench_rz.
  bool wrench = false;
  std::vector<std::string> notes;  ///< what was guessed or left out
  int duplicates = 0;              ///< samples left out because another has the same time
  int out_of_order = 0;  ///< samples left out because their time is before that of the one before
};

/// Reads an LCM log with DASHPOT_STATE messages (channels q1 ..., v1 ..., tau1 ... and wrench_x
/// ...), or a CSV file: a line of names with units ("q1 [rad]", "q1 (deg)", "q1_deg"; without a
/// unit q is in rad, qd, dq and v in rad/s, tau and torque in N m, time in s, utime in us), then
/// numbers between commas, semicolons (with decimal commas, too), tabs or spaces. The names may be
/// in a comment, as numpy.savetxt writes them. An empty cell or nan is a sample that is missing;
/// columns that begin with text are left out. One column is the time: t, time, timestamp, stamp or
/// utime; where no unit is given and its steps are no seconds, it is in ms, us or ns. Throws
/// InputError that names the file, the line and the column.
MotionFile read_motion_file(const std::string& path);

/// Numbers of the channels called `names`, "q1,q2"; of those that are positions, or else
/// velocities, if that is empty, without those that are desired ("q_d_0", "pos_cmd") or in
/// `others`. Throws InputError with `option` as key.
std::vector<Eigen::Index> chosen_channels(const std::vector<MotionChannel>& channels,
                                          const std::string& names,
                                          const std::vector<Eigen::Index>& others = {},
                                          const std::string& option = "--channels");

}  // namespace dashpot::apps
