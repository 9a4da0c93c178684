#pragma once
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
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

/// What a page shows at one time: the last message of each kind, and the alarms.
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

}  // namespace dashpot::apps
