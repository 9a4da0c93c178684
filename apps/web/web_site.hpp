#pragma once
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/apps/web/http_server.hpp>
#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dashpot::apps {

/// The worst values so far. Soft modes do not count, because their ratio means nothing.
struct Alarms {
  std::optional<double> wanted_ratio;    ///< that the springs' damping is designed for; 0: none
  std::int64_t changes_of_ratio = 0;     ///< how often the wanted ratio changed
  std::optional<double> smallest_ratio;  ///< since the last of these changes
  std::int64_t worst_utime = 0;          ///< us
  std::vector<double> worst_posture;     ///< joint positions of the smallest ratio, rad or m
  std::optional<double> smallest_margin;
  std::int64_t bounds_lost = 0;  ///< modes messages with a bound that is infinite
  std::int64_t modes_lost = 0;   ///< modes messages whose status is an error
  std::int64_t faults = 0;       ///< faults that latched

  void take(const state_t& message);
  void take(const modes_t& message);
  void take(const sampled_modes_t& message);

 private:
  std::int64_t fault_tick_ = 0;
  std::int64_t changed_at_ = 0;  ///< tick of the last change of the wanted ratio
};

/// The content of a page at one time: the last message of each kind, and the alarms.
struct Frame {
  std::optional<state_t> state;
  std::optional<modes_t> modes;
  std::optional<sampled_modes_t> sampled;
  Alarms alarms;
  std::int64_t messages = 0;
  std::int64_t utime = 0;  ///< of the last message, us
  double age = 0;          ///< since the last message came, s

  void take(const state_t& message) { take_as(state, message); }
  void take(const modes_t& message) { take_as(modes, message); }
  void take(const sampled_modes_t& message) { take_as(sampled, message); }

  /// Returns {"utime", "messages", "age", "state", "modes", "sampled", "alarms"}; a message that
  /// has not come is null.
  nlohmann::ordered_json json() const;

 private:
  template <class Message>
  void take_as(std::optional<Message>& last, const Message& message) {
    alarms.take(message);
    ++messages;
    utime = message.utime;
    last = message;
  }
};

/// JSON text of a document, on one line. Invalid UTF-8 is replaced.
std::string line_of(const nlohmann::ordered_json& document);

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

/// The file of the page at a path ("/monitor/main.js"), and its type; null at any other path. The
/// files are part of the program.
struct PageFile {
  std::string_view path, type, text;
};
const PageFile* find_page_file(std::string_view path);

/// Serves the pages of `dashpot monitor --web` with a live frame, or the frames of a log.
class WebSite {
 public:
  /// `source` is its name on the page. Without `log` it is live. `identified` is the JSON of
  /// measured modes, or null.
  WebSite(std::string source, std::optional<ArmView> arm, std::unique_ptr<LogFrames> log,
          nlohmann::ordered_json identified);

  /// Takes a message of the live bus; from any thread.
  template <class Message>
  void take(const Message& message) {
    const std::lock_guard lock(mutex_);
    frame_.take(message);
    came_at_ = std::chrono::steady_clock::now();
  }
  /// A request cannot change what the server shows. On the server's thread.
  HttpAnswer answer(const std::string& path, const std::map<std::string, std::string>& query);
  /// The next event, or null if there was no message since the last one and a second has not
  /// passed. On the server's thread.
  std::shared_ptr<const std::string> next_event();
  bool live() const { return log_ == nullptr; }

 private:
  Frame live_frame() const;  ///< mutex_ is held
  Frame frame_at(const std::map<std::string, std::string>& query);
  nlohmann::ordered_json setup() const;
  HttpAnswer response(const std::map<std::string, std::string>& query);

  std::string source_;
  std::optional<ArmView> arm_;
  std::unique_ptr<LogFrames> log_;
  nlohmann::ordered_json identified_;
  std::mutex mutex_;
  Frame frame_;
  std::chrono::steady_clock::time_point came_at_ = std::chrono::steady_clock::now();
  std::int64_t sent_ = -1;
  std::chrono::steady_clock::time_point sent_at_{};
};

}  // namespace dashpot::apps
