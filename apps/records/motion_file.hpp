#pragma once
#include <dashpot/controller/input_error.hpp>

#include <Eigen/Core>
#include <string>
#include <string_view>
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

/// Rows of samples, in the order of time.
class Rows {
 public:
  static constexpr std::size_t kLeast = 20;

  explicit Rows(MotionFile& file) : file_(file) {}

  /// The sample at `time` (s): `count` values.
  bool add(double time, const double* values, std::size_t count) {
    if (!times_.empty() && time <= times_.back()) {
      ++(time == times_.back() ? file_.duplicates : file_.out_of_order);
      return false;
    }
    times_.push_back(time);
    values_.insert(values_.end(), values, values + count);
    return true;
  }

  std::size_t size() const { return times_.size(); }

  void finish() {
    if (times_.size() < kLeast) {
      const std::string same = file_.duplicates == 0
                                   ? ""
                                   : "; " + std::to_string(file_.duplicates) +
                                         " more have the time of another: it needs more digits";
      throw controller::InputError(
          "", std::to_string(times_.size()) + " samples, need 20 or more" + same);
    }
    const auto N = static_cast<Eigen::Index>(times_.size());
    file_.time = Eigen::Map<const Eigen::VectorXd>(times_.data(), N).array() - times_.front();
    file_.values = Eigen::Map<const Eigen::MatrixXd>(
        values_.data(), static_cast<Eigen::Index>(file_.channels.size()), N);
  }

 private:
  MotionFile& file_;
  std::vector<double> times_, values_;
};

/// See read_motion_file; `text` is all of a CSV file.
MotionFile read_csv(std::string_view text, const FileHints& hints = {});

}  // namespace dashpot::apps
