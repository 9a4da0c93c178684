#pragma once
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <string>

namespace dashpot::apps {

/// Text of `dashpot monitor`: the last messages, and statistics of all.
class MonitorView {
 public:
  void take(const state_t& message);
  void take(const modes_t& message);
  void take(const sampled_modes_t& message);

  /// Whether states of more than one loop come over the bus. Messages do not name their sender: the
  /// evidence is ticks that go back, and then on from where they were.
  bool mixed() const { return returns_ > 2; }
  bool empty() const { return !state_ && !modes_ && !sampled_; }
  /// Time of the last message, s since the first one.
  double time() const {
    return 1e-6 * (static_cast<double>(last_utime_) - static_cast<double>(first_utime_));
  }

  /// Everything, as a screen of text. `bold` marks headings for a terminal.
  std::string screen(bool bold) const;
  /// Returns the state on one line, ended by a newline.
  std::string line() const;
  /// Returns statistics of all messages, and the modes at the end; `malformed` were not shown.
  std::string summary(std::int64_t malformed) const;

 private:
  void note_time(std::int64_t utime);
  void note_order(std::int64_t tick);
  std::string health() const;
  std::string commands() const;
  std::string joints() const;
  std::string modes_table() const;
  std::string sampled_table() const;

  std::optional<state_t> state_;
  std::optional<modes_t> modes_;
  std::optional<sampled_modes_t> sampled_;
  std::int64_t first_utime_ = 0;  // us
  std::int64_t last_utime_ = 0;   // us
  // Ticks a second: over about the last second
  std::int64_t rate_utime_ = 0;  // us
  std::int64_t rate_tick_ = 0;
  double rate_ = 0;  // 1/s
  // Whether there is another loop: the tick from which they went back, how often they returned, and
  // whether the last message, and the one before it, repeated a tick
  std::int64_t left_at_ = 0;
  std::array<bool, 2> repeated_{};
  std::int64_t returns_ = 0;
  // Sums
  std::int64_t states_ = 0;
  std::int64_t modes_messages_ = 0;
  std::int64_t modes_lost_ = 0;  // by their sequence
  std::array<std::int64_t, 256> statuses_{};
  double largest_error_ = 0;  // of the tip, m
};

}  // namespace dashpot::apps
