#pragma once
#include <dashpot/apps/records/recorded_motion.hpp>
#include <dashpot/controller/input_error.hpp>

#include <string_view>
#include <vector>

namespace dashpot::apps {

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
