#pragma once
#include <dashpot/lcmtypes/command.hpp>
#include <dashpot/lcmtypes/command_limits.hpp>
#include <dashpot/lcmtypes/command_t.hpp>
#include <dashpot/lcmtypes/command_verdict.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

namespace dashpot::lcmtypes {

/// Decides last about a command that passed all other checks and is contained in `command`. Returns
/// true if the command is accepted, and false if the controller refuses its gains; `reason` then
/// says why, in one line. If the command sets the tip's pose, it sets Command::pose_tool, because
/// only the controller knows the current T.
using CommandTaker = std::function<bool(Command& command, std::string& reason)>;

/// Decides which commands are accepted, and accumulates what they set. Judging needs no memory
/// beyond the memory of one decoded message, and the work is bounded.
///
/// One sender at a time commands: the first whose command is accepted, until it gives up or none of
/// its commands is accepted for longer than `silence`. A command of another sender is refused by
/// its first bytes: it is not decoded, and does not count toward the limit of commands a second.
///
/// A command is accepted if its values are in order and it is neither older than `oldest` nor ahead
/// by more than `furthest`. Within oldest + furthest of its sender's last accepted command, its
/// time and sequence must both be above the ones of that command. So no recorded command is
/// accepted twice, because after oldest + furthest it is too old. A sender may begin its sequence
/// again after a silence as long as this.
class CommandFilter {
 public:
  /// Throws std::invalid_argument unless the position limits are of one length, 1 to 16. Without
  /// `take` every command is accepted that passes the other checks.
  explicit CommandFilter(const CommandLimits& limits, CommandTaker take = {});

  /// Judges `size` bytes that arrived at `utime` (us since 1970-01-01 UTC), which is `steady` us on
  /// a clock that is never set. `command` changes only if the verdict is kAccepted.
  CommandVerdict judge(const void* data, std::size_t size, std::int64_t utime,
                       std::int64_t steady) noexcept;
  /// Ends the command of a sender that has been silent for too long at the time `steady`, us.
  void notice_silence(std::int64_t steady) noexcept;
  /// Sets the fault that a command may release, by the tick at which it latched; 0: none.
  void set_fault_tick(std::int64_t tick) noexcept { fault_tick_ = tick; }

  const Command& command() const noexcept { return command_; }
  const CommandTally& tally() const noexcept { return tally_; }
  /// Returns why the last refused command was refused, in one line; "" if none was refused.
  const std::string& last_reason() const noexcept { return last_reason_; }

 private:
  /// The last accepted command of one sender; sender 0: an unused entry.
  struct Last {
    std::int64_t sender = 0;
    std::int64_t utime = 0;
    std::int64_t sequence = 0;
    std::int64_t accepted_at = 0;  ///< steady, us
  };
  CommandVerdict judge_sender(std::int64_t sender) const noexcept;
  CommandVerdict judge_message(const command_t& message, std::int64_t utime, std::int64_t steady);
  CommandVerdict judge_time(const command_t& message, std::int64_t utime,
                            const Last& last) const noexcept;
  void accept(const command_t& message, const Command& next, std::int64_t steady, Last& last);
  /// Returns the entry of a sender, or an unused entry for it; null if other senders need all
  /// entries.
  Last* place_of(std::int64_t sender, std::int64_t steady) noexcept;
  bool take_token(std::int64_t steady) noexcept;

  CommandLimits limits_;
  CommandTaker take_;
  Command command_;
  CommandTally tally_;
  std::string reason_;  ///< reason for refusing the judged command, if known
  std::string last_reason_;
  std::array<Last, 8> last_{};
  std::int64_t heard_at_ = 0;    ///< when a command of the commander was last accepted; steady, us
  std::int64_t fault_tick_ = 0;  ///< of the latched fault; 0: none
  double tokens_ = 0;            ///< number of further commands that may be accepted at once
  std::int64_t tokens_at_ = 0;   ///< when `tokens_` was computed; steady, us
};

}  // namespace dashpot::lcmtypes
