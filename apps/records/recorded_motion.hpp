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

/// Properties that a file lacks.
struct FileHints {
  double rate = 0;      ///< samples in a second, of files without a time; 0: they have one
  std::string columns;  ///< "time [s],q1 [rad]": the names of files without a line of them
};

/// A recorded motion.
struct MotionFile {
  std::vector<MotionChannel> channels;
  Eigen::VectorXd time;    ///< s, strictly rising, from the first sample
  Eigen::MatrixXd values;  ///< channels x samples, SI; NaN where a sample is missing
  /// For each sample whether the status was ok and reference and wrench were constant; empty for
  /// CSV files.
  std::vector<bool> free;
  std::vector<bool> rests;  ///< the same, whatever the wrench does
  /// True for a log whose springs are at the joints throughout: the tip's wrench then comes from an
  /// excitation alone, and is in channels wrench_x ... wrench_rz.
  bool wrench = false;
  std::vector<std::string> notes;  ///< what was guessed or left out
  int duplicates = 0;              ///< samples left out because another has the same time
  int out_of_order = 0;  ///< samples left out because their time is before the previous one
};

}  // namespace dashpot::apps
