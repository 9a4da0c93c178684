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

/// The last to be asked about a command that is otherwise in order, and that `command` contains.
/// Returns false if the controller refuses its gains; `reason` then says why, in one line. What it
/// returns true for is accepted.
using CommandTaker = std::function<bool(const Command& command, std::string& reason)>;

/// Decides which commands count, and adds up what they set. Judging needs no memory of its own
/// beyond that of one decoded message, and the work is bounded.
///
/// One sender at a time commands: the first of whom a command is accepted, until it gives up or
/// none of its commands is accepted for longer than `silence`. A command of another sender is
/// refused by its first bytes: it is not decoded, and does not count toward the limit of commands a
/// second.
///
/// A command counts if its values are in order and it is neither older than `oldest` nor ahead by
/// more than `furthest`; and, within oldest + furthest of its sender's last accepted command, if
/// its time and sequence are both above that command's. So no recorded command counts twice: later
/// than that its age gives it away. A sender may begin its sequence again after that silence.
class CommandFilter {
 public:
  /// Throws std::invalid_argument unless the position limits are of one length, 1 to 16. Without
  /// `take` all is accepted that is in order.
  explicit CommandFilter(const CommandLimits& limits, CommandTaker take = {});

  /// Judges `size` bytes that arrived at `utime` (us since 1970-01-01 UTC), which is `steady` us on
  /// a clock that nobody sets. Only if the answer is kAccepted does `command` change.
  CommandVerdict judge(const void* data, std::size_t size, std::int64_t utime,
                       std::int64_t steady) noexcept;
  /// Takes note that it is `steady`: whoever has been silent for too long no longer commands.
  void notice_silence(std::int64_t steady) noexcept;
  /// The fault that a command may release, by the tick at which it latched; 0: none.
  void set_fault_tick(std::int64_t tick) noexcept { fault_tick_ = tick; }

  const Command& command() const noexcept { return command_; }
  const CommandTally& tally() const noexcept { return tally_; }
  /// Why the last command that was refused was refused, in one line; "" if none was.
  const std::string& last_reason() const noexcept { return last_reason_; }

 private:
  /// The last accepted command of one sender; sender 0: of nobody.
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
  /// Where to remember the sender: what is remembered of it, or an unused place; null if all are
  /// needed for others.
  Last* place_of(std::int64_t sender, std::int64_t steady) noexcept;
  bool take_token(std::int64_t steady) noexcept;

  CommandLimits limits_;
  CommandTaker take_;
  Command command_;
  CommandTally tally_;
  std::string reason_;  ///< of `take_`, for the command that is judged just now
  std::string last_reason_;
  std::array<Last, 8> last_{};
  std::int64_t heard_at_ = 0;    ///< when a command of the commander was last accepted; steady, us
  std::int64_t fault_tick_ = 0;  ///< of the fault that is latched
  double tokens_ = 0;            ///< how many more commands may be accepted at once
  std::int64_t tokens_at_ = 0;   ///< when there were so many; steady, us
};

}  // namespace dashpot::lcmtypes
