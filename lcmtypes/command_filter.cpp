#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/lcmtypes/command_values.hpp>
#include <dashpot/lcmtypes/message_check.hpp>

#include <algorithm>
#include <stdexcept>

namespace dashpot::lcmtypes {

const char* to_text(CommandVerdict verdict) noexcept {
  switch (verdict) {
    case CommandVerdict::kAccepted:
      return "accepted";
    case CommandVerdict::kMalformed:
      return "not the bytes of a command";
    case CommandVerdict::kWrongSize:
      return "wrong number of joints";
    case CommandVerdict::kUnknown:
      return "unknown part, mode or frame";
    case CommandVerdict::kNotFinite:
      return "not finite";
    case CommandVerdict::kNotUnit:
      return "quaternion not of length 1";
    case CommandVerdict::kOutOfLimits:
      return "out of limits";
    case CommandVerdict::kIndefinite:
      return "gains not symmetric positive semidefinite";
    case CommandVerdict::kStale:
      return "too old";
    case CommandVerdict::kFromFuture:
      return "from the future";
    case CommandVerdict::kReplayed:
      return "replayed or out of order";
    case CommandVerdict::kTooMany:
      return "too many";
  }
  return "unknown";
}

CommandFilter::CommandFilter(const CommandLimits& limits) : limits_(limits), tokens_(limits.burst) {
  const Eigen::Index n = limits.position_lower.size();
  if (n < 1 || limits.position_upper.size() != n) {
    throw std::invalid_argument(
        "limits of commands: position_lower and position_upper must be of one length, 1 to 16");
  }
}

CommandVerdict CommandFilter::judge(const void* data, std::size_t size, std::int64_t utime,
                                    std::int64_t steady) noexcept {
  try {
    command_t message;
    if (!decode(data, size, message)) return CommandVerdict::kMalformed;
    const CommandVerdict time = judge_time(message, utime, steady);
    if (time != CommandVerdict::kAccepted) return time;
    Command next = command_;
    const CommandVerdict values = copy_values(message, limits_, next);
    if (values != CommandVerdict::kAccepted) return values;
    if (!take_token(steady)) return CommandVerdict::kTooMany;
    command_ = next;
    accepted_at_ = steady;
    any_ = true;
    return CommandVerdict::kAccepted;
  } catch (...) {  // out of memory
    return CommandVerdict::kMalformed;
  }
}

CommandVerdict CommandFilter::judge_time(const command_t& message, std::int64_t utime,
                                         std::int64_t steady) const noexcept {
  if (message.utime < utime - limits_.oldest) return CommandVerdict::kStale;
  if (message.utime > utime + limits_.furthest) return CommandVerdict::kFromFuture;
  const bool remembered = any_ && steady - accepted_at_ <= limits_.oldest + limits_.furthest;
  const bool rises = message.utime > command_.utime && message.sequence > command_.sequence;
  return remembered && !rises ? CommandVerdict::kReplayed : CommandVerdict::kAccepted;
}

bool CommandFilter::take_token(std::int64_t steady) noexcept {
  const double elapsed = 1e-6 * static_cast<double>(steady - tokens_at_);
  tokens_ = std::min(limits_.burst, tokens_ + limits_.most_per_second * std::max(0.0, elapsed));
  tokens_at_ = steady;
  if (tokens_ < 1) return false;
  tokens_ -= 1;
  return true;
}

}  // namespace dashpot::lcmtypes
