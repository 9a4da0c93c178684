#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace dashpot::lcmtypes {

/// Result of judging a command that arrived. state_t has the same numbers.
enum class CommandVerdict : std::uint8_t {
  kAccepted,
  kMalformed,    ///< not the bytes of a command_t
  kWrongSize,    ///< not the robot's number of joints
  kUnknown,      ///< no part, or a part, mode or frame that does not exist
  kNotFinite,    ///< NaN or infinity in a part that is set
  kNotUnit,      ///< the length of the quaternion is not 1 within 0.001
  kOutOfLimits,  ///< a value beyond CommandLimits
  kIndefinite,   ///< gains that are not symmetric positive semidefinite
  kStale,        ///< too old
  kFromFuture,   ///< its time is too far ahead
  kReplayed,     ///< utime or sequence not above the sender's last accepted command
  kTooMany,      ///< faster than most_per_second, or from too many senders in turn
  kNoSender,     ///< the sender is 0
  kOtherSender,  ///< another sender commands the arm
  kUnstable,     ///< the controller refuses the gains
  kNoSuchFault,  ///< asks to release a fault other than the latched one
};
inline constexpr std::size_t kCommandVerdicts = 16;

/// Returns "accepted", "not the bytes of a command", ...
const char* to_text(CommandVerdict verdict) noexcept;

/// Verdicts of all commands so far, and the sender that commands.
struct CommandTally {
  std::array<std::int64_t, kCommandVerdicts> verdicts{};    ///< number of commands with each
  CommandVerdict last_refusal = CommandVerdict::kAccepted;  ///< kAccepted: none was refused
  std::int64_t last_refusal_utime = 0;   ///< when it arrived, us since 1970-01-01 UTC
  std::int64_t last_refused_sender = 0;  ///< 0: it could not be read
  std::int64_t commander = 0;            ///< the sender that commands the arm; 0: none

  std::int64_t count(CommandVerdict verdict) const noexcept {
    return verdicts[static_cast<std::size_t>(verdict)];
  }
  std::int64_t accepted() const noexcept { return count(CommandVerdict::kAccepted); }
  std::int64_t rejected() const noexcept {
    std::int64_t sum = 0;
    for (const std::int64_t verdict : verdicts) sum += verdict;
    return sum - accepted();
  }
};

}  // namespace dashpot::lcmtypes
