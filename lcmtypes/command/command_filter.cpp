#include <dashpot/lcmtypes/command/command_values.hpp>
#include <dashpot/lcmtypes/command_filter.hpp>
#include <dashpot/lcmtypes/message_check.hpp>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace dashpot::lcmtypes {

using Verdict = CommandVerdict;

namespace {

/// The parts that take long to judge, before they are accepted. Goals do not: the latest of a burst
/// counts.
constexpr std::int32_t kJudged = int{command_t::JOINT_GAINS} | int{command_t::TASK_GAINS} |
                                 int{command_t::NULL_GAINS} | int{command_t::TASK_RATIO} |
                                 int{command_t::JOINT_RATIO} | int{command_t::PAYLOAD} |
                                 int{command_t::TOOL_FRAME};

}  // namespace

CommandFilter::CommandFilter(const CommandLimits& limits, CommandTaker take)
    : limits_(limits), take_(std::move(take)), tokens_(limits.burst) {
  const Eigen::Index n = limits.position_lower.size();
  if (n < 1 || limits.position_upper.size() != n) {
    throw std::invalid_argument(
        "limits of commands: position_lower and position_upper must be of one length, 1 to 16");
  }
}

CommandVerdict CommandFilter::judge(const void* data, std::size_t size, std::int64_t utime,
                                    std::int64_t steady) noexcept {
  notice_silence(steady);
  std::int64_t sender = 0;
  Verdict verdict = Verdict::kMalformed;
  try {
    reason_.clear();
    command_t message;
    if (read_sender(data, size, sender)) {
      verdict = judge_sender(sender);
      if (verdict == Verdict::kAccepted) {
        verdict = decode(data, size, message) ? judge_message(message, utime, steady)
                                              : Verdict::kMalformed;
      }
    }
    if (verdict != Verdict::kAccepted) {
      last_reason_ = to_text(verdict);
      if (!reason_.empty()) last_reason_ += ": " + reason_;
    }
  } catch (...) {  // out of memory
    verdict = Verdict::kMalformed;
  }
  ++tally_.verdicts[static_cast<std::size_t>(verdict)];
  if (verdict != Verdict::kAccepted) {
    tally_.last_refusal = verdict;
    tally_.last_refusal_utime = utime;
    tally_.last_refused_sender = sender;
  }
  return verdict;
}

void CommandFilter::notice_silence(std::int64_t steady) noexcept {
  if (steady - heard_at_ > limits_.silence) tally_.commander = 0;
}

CommandVerdict CommandFilter::judge_sender(std::int64_t sender) const noexcept {
  if (sender == 0) return Verdict::kNoSender;
  const bool free = tally_.commander == 0 || tally_.commander == sender;
  return free ? Verdict::kAccepted : Verdict::kOtherSender;
}

CommandVerdict CommandFilter::judge_message(const command_t& message, std::int64_t utime,
                                            std::int64_t steady) {
  Last* last = place_of(message.sender, steady);
  if (last == nullptr) return Verdict::kTooMany;
  const Verdict time = judge_time(message, utime, *last);
  if (time != Verdict::kAccepted) return time;
  Command next = command_;
  const Verdict values = copy_values(message, limits_, next, reason_);
  if (values != Verdict::kAccepted) return values;
  const bool releases = (message.parts & command_t::RELEASE) != 0;
  if (releases && (fault_tick_ == 0 || message.fault_tick != fault_tick_)) {
    return Verdict::kNoSuchFault;
  }
  if ((message.parts & kJudged) != 0 && !take_token(steady)) return Verdict::kTooMany;
  if (take_ && !take_(next, reason_)) return Verdict::kUnstable;
  accept(message, next, steady, *last);
  return Verdict::kAccepted;
}

CommandVerdict CommandFilter::judge_time(const command_t& message, std::int64_t utime,
                                         const Last& last) const noexcept {
  if (message.utime < utime - limits_.oldest) return Verdict::kStale;
  if (message.utime > utime + limits_.furthest) return Verdict::kFromFuture;
  const bool rises = message.utime > last.utime && message.sequence > last.sequence;
  return last.sender == message.sender && !rises ? Verdict::kReplayed : Verdict::kAccepted;
}

void CommandFilter::accept(const command_t& message, const Command& next, std::int64_t steady,
                           Last& last) {
  command_ = next;
  last = {message.sender, message.utime, message.sequence, steady};
  heard_at_ = steady;
  // A new commander finds the bucket full, however much other senders took out of it.
  if (tally_.commander != message.sender) tokens_ = limits_.burst - 1;
  tally_.commander = (message.parts & command_t::GIVE_UP) != 0 ? 0 : message.sender;
}

CommandFilter::Last* CommandFilter::place_of(std::int64_t sender, std::int64_t steady) noexcept {
  Last* unused = nullptr;
  for (Last& last : last_) {
    if (steady - last.accepted_at > limits_.oldest + limits_.furthest) last.sender = 0;
    if (last.sender == sender) return &last;
    if (last.sender == 0) unused = &last;
  }
  return unused;
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
