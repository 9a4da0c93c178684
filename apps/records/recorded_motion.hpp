#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

namespace dashpot::apps {

/// One channel of a recorded motion.
struct MotionChannel {
  std::string name;
  std::string unit;  ///< SI: rad, m, rad/s, m/s, N m, N; or the file's own; empty if it has none
  std::string problem = {};  ///< why it cannot be used; empty if it can
};

/// What a file does not say of itself.
struct FileHints {
  double rate = 0;      ///< samples in a second, of files without a time; 0: they have one
  std::string columns;  ///< "time [s],q1 [rad]": the names of files without a line of them
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
  /// True of a log whose springs are at the joints throughout: the tip's wrench is then that of an
  /// excitation alone, and in channels wrench_x ... wrench_rz.
  bool wrench = false;
  std::vector<std::string> notes;  ///< what was guessed or left out
  int duplicates = 0;              ///< samples left out because another has the same time
  int out_of_order = 0;  ///< samples left out because their time is before that of the one before
};

}  // namespace dashpot::apps
