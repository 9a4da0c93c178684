#pragma once
#include <dashpot/lcmtypes/command.hpp>
#include <dashpot/lcmtypes/command_t.hpp>

#include <array>
#include <cstddef>
#include <cstdint>

namespace dashpot::lcmtypes {

/// What a command may ask for. Position limits are the robot's; the other defaults are wide enough
/// for any arm of human size.
struct CommandLimits {
  controller::JointVector position_lower;  ///< n, rad
  controller::JointVector position_upper;  ///< n, rad
  double reach = 3;                        ///< of the tip from the origin of the base link, m
  double force = 200;                      ///< each entry of the wrench, N
  double torque = 50;                      ///< N m
  double joint_stiffness = 20000;          ///< each entry, also in the null space, N m/rad
  double joint_damping = 2000;             ///< N m s/rad
  double task_stiffness = 50000;           ///< each entry, N/m, N/rad, N m/rad
  double task_damping = 5000;              ///< N s/m, N s/rad, N m s/rad
  std::int64_t oldest = 500'000;           ///< a command may be this old when it arrives, us
  std::int64_t furthest = 100'000;         ///< its time may be this far ahead of the receiver's, us
  double most_per_second = 2000;           ///< accepted commands; more are dropped
  double burst = 50;                       ///< of which so many may come at once
};

enum class CommandVerdict : std::uint8_t {
  kAccepted,
  kMalformed,    ///< not the bytes of a command_t
  kWrongSize,    ///< not the robot's number of joints
  kUnknown,      ///< no part, or a part, mode or frame that there is not
  kNotFinite,    ///< NaN or infinity in a part that is set
  kNotUnit,      ///< the length of the quaternion is not 1 within 0.001
  kOutOfLimits,  ///< a value beyond CommandLimits
  kIndefinite,   ///< gains that are not symmetric positive semidefinite
  kStale,        ///< too old
  kFromFuture,   ///< its time is too far ahead
  kReplayed,     ///< utime or sequence not above those of the last accepted command
  kTooMany,      ///< faster than most_per_second
};
inline constexpr std::size_t kCommandVerdicts = 12;

/// "accepted", "not the bytes of a command", ...
const char* to_text(CommandVerdict verdict) noexcept;

/// Decides which commands count, and adds up what they set. Judging needs no memory of its own
/// beyond that of one decoded message, and the work is bounded.
///
/// A command counts if its values are in order and it is neither older than `oldest` nor ahead by
/// more than `furthest`; and, within oldest + furthest of the last accepted command, if its time
/// and sequence are both above that command's. So no recorded command counts twice: later than that
/// its age gives it away. A sender that starts again may begin its sequence anew after that
/// silence.
class CommandFilter {
 public:
  /// Throws std::invalid_argument unless the position limits are of one length, 1 to 16.
  explicit CommandFilter(const CommandLimits& limits);

  /// Judges `size` bytes that arrived at `utime` (us since 1970-01-01 UTC), which is `steady` us on
  /// a clock that nobody sets. Only if the answer is kAccepted does `command` change.
  CommandVerdict judge(const void* data, std::size_t size, std::int64_t utime,
                       std::int64_t steady) noexcept;

  const Command& command() const noexcept { return command_; }

 private:
  CommandVerdict judge_time(const command_t& message, std::int64_t utime,
                            std::int64_t steady) const noexcept;
  bool take_token(std::int64_t steady) noexcept;

  CommandLimits limits_;
  Command command_;
  bool any_ = false;              ///< whether one was ever accepted
  std::int64_t accepted_at_ = 0;  ///< steady, us
  double tokens_ = 0;             ///< how many more commands may be accepted at once
  std::int64_t tokens_at_ = 0;    ///< when there were so many; steady, us
};

}  // namespace dashpot::lcmtypes
