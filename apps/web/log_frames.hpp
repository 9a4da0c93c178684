#pragma once
#include <dashpot/apps/web/frame.hpp>
#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// The frames of a log by time. The log is read once, and an index of at most kMostEntries places
/// is kept: a frame is found by reading on from the place before it.
class LogFrames {
 public:
  static constexpr std::size_t kMostEntries = 20000;

  /// Reads the log through; `stop` ends that early. Throws std::runtime_error that names the file.
  LogFrames(const std::string& path, const std::function<bool()>& stop);

  bool empty() const { return entries_.empty(); }
  /// Time from the first event to the last, s.
  double duration() const { return 1e-6 * static_cast<double>(duration_); }
  const std::string& damage() const { return damage_; }
  std::int64_t malformed() const { return malformed_; }

  /// Returns the frame after all messages up to `time`, s since the first event, as if the log had
  /// been read from its beginning.
  Frame at(double time);
  /// Returns curves of the whole log, at most about `most` points: {"time", "tick_time", "status",
  /// "mode": {label: {"natural_frequency", "damping_ratio"}}}. Null: the mode was not found.
  nlohmann::ordered_json history(std::size_t most) const;

 private:
  /// A place in the log with the frame before it. Of large messages only the places are kept.
  struct Entry {
    std::int64_t time = 0;  ///< since the first event, us
    std::uint64_t offset = 0;
    std::int64_t state = -1, modes = -1, sampled = -1;  ///< offsets of the last ones before
    std::int64_t messages = 0, frame_utime = 0;
    std::uint32_t alarms = 0;  ///< index into alarms_
    float tick_time = 0;       ///< us
    std::int8_t status = 0;
    std::vector<std::array<float, 3>> curves;  ///< label, rad/s, ratio
  };

  void add(const Entry& entry);
  void read_one(std::int64_t offset, Frame& frame);

  lcmtypes::LogFile file_;
  std::vector<Entry> entries_;
  std::vector<Alarms> alarms_;
  std::int64_t interval_ = 33'000;  ///< between entries, us
  std::int64_t first_ = 0;          ///< time of the first event, us
  std::int64_t duration_ = 0;       ///< us
  std::int64_t malformed_ = 0;
  std::string damage_;
};

}  // namespace dashpot::apps
