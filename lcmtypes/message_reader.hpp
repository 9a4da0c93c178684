#pragma once
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/log_file.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>

namespace dashpot::lcmtypes {

/// Functions that get the well-formed messages of a controller, from a bus or from a log.
struct MessageHandlers {
  std::function<void(const state_t&)> on_state;
  std::function<void(const modes_t&)> on_modes;
  std::function<void(const sampled_modes_t&)> on_sampled_modes;
  std::function<void(const contact_t&)> on_contact;
  std::int64_t malformed = 0;  ///< messages on our channels that were not handed on

  /// Decodes a message and hands it on. Ignores other channels.
  void take(std::string_view channel, const void* data, std::size_t size);
};

/// Reads messages from a live bus. `handlers` must outlive it.
class BusReader {
 public:
  BusReader(std::shared_ptr<lcm::LCM> bus, MessageHandlers& handlers);
  ~BusReader();
  BusReader(const BusReader&) = delete;
  BusReader& operator=(const BusReader&) = delete;

  /// Handles one message, or gives up after `milliseconds`. Returns false if the bus is at
  /// its end (a file:// log, or broken).
  bool wait(int milliseconds);

 private:
  struct Subscriptions;
  std::shared_ptr<lcm::LCM> bus_;
  std::unique_ptr<Subscriptions> subscriptions_;
};

/// Reads messages from a log written by make_log_sink or lcm-logger. `handlers` must outlive it.
class LogReader {
 public:
  /// Opens a log. Throws std::runtime_error that names the file and the reason.
  LogReader(const std::string& path, MessageHandlers& handlers)
      : file_(path), handlers_(handlers) {}

  /// Reads the next event. Returns false at the end of the log.
  bool read() { return file_.read(); }
  /// Returns the time of the event read last, us since 1970-01-01 UTC.
  std::int64_t utime() const { return file_.event().utime; }
  /// Returns where the event read last begins, bytes.
  std::uint64_t offset() const noexcept { return file_.offset(); }
  /// Hands on the event read last.
  void handle();
  /// Returns what was found wrong with the log so far; "" if nothing. See
  /// describe(LogFile::Damage).
  std::string damage() const { return describe(file_.damage()); }
  /// Explains an empty result if no event handed on was on a channel of Dashpot's: "has no messages
  /// of Dashpot; its channels are ..."; "" if one was, or none was read.
  std::string foreign() const;

 private:
  LogFile file_;
  MessageHandlers& handlers_;
  bool ours_ = false;
  std::set<std::string> others_;  ///< channels of others, the first ones
};

}  // namespace dashpot::lcmtypes
