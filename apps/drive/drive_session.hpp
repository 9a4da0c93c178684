#pragma once
#include <dashpot/apps/identify/identify.hpp>
#include <dashpot/apps/loop/loop_journal.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/lcmtypes/driver.hpp>

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

namespace dashpot::apps {

/// Counts and times of the messages to and from a driver.
struct DriveRecord {
  std::int64_t statuses = 0;    ///< readable ones that arrived
  std::int64_t unreadable = 0;  ///< messages on the status channel other than this arm's statuses
  std::int64_t repeated = 0;    ///< statuses not newer than an earlier one: not answered
  std::int64_t overtaken = 0;   ///< statuses with a newer one behind them: not answered
  std::int64_t late = 0;        ///< statuses older than two periods: not answered
  std::int64_t awaited = 0;     ///< statuses after a pause of the driver: not answered
  std::int64_t lost = 0;        ///< periods without a status between two of them
  std::int64_t stopped = 0;     ///< statuses of a robot that has stopped by itself: not answered
  std::int64_t commands = 0;    ///< sent
  double period = 0;            ///< measured before the start, s
  JointVector external;         ///< greatest external torque of each joint, N m
  /// Commands by the time from a status's arrival to the command, us; the last: longer ones. The
  /// size is fixed, because growing takes the loop milliseconds after an hour.
  std::vector<std::int64_t> latencies = std::vector<std::int64_t>(20'000);
  double longest_latency = 0;  ///< us
};

/// The conversation with a driver: for each status at most one command. Refuses to begin unless
/// everything is in order, and does nothing by itself: the driver is the clock.
///
/// Before the first command, statuses are watched for 0.3 s. Then the springs start where the robot
/// is. A status that is repeated, out of order, or older than two periods is not answered; after a
/// gap longer than watchdog.longest_gap the controller latches a fault. A driver whose robot has
/// stopped by itself is not answered until it goes on. A driver that paused for 0.3 s, or whose
/// clock became unknown, is answered only after 0.3 s of statuses: it may have been restarted.
class DriveSession {
 public:
  struct Options {
    lcmtypes::DriverKind driver = lcmtypes::DriverKind::kIiwa;
    bool dry_run = false;  ///< computes and publishes everything, and commands nothing
  };

  /// All must outlive it. Throws InputError, which names the key, if the configuration is not one
  /// for this driver's loop.
  DriveSession(const controller::Config& config, LoopController& controller, LoopGoal& goal,
               LoopJournal& journal, const Options& options);

  /// Takes a status at `now`, us since 1970-01-01 UTC, that LCM read at `arrived`. Returns
  /// true if `command` is to be sent. Throws InputError if the conversation must not begin, and
  /// std::runtime_error if it must not go on.
  bool take(const lcmtypes::DriverStatus& status, std::int64_t arrived, std::int64_t now,
            lcmtypes::DriverCommand& command);
  /// True unless the status is too old for `command` to be sent. Always true if the driver's clock
  /// is not the time of day: in lock-step a status waits for its answer.
  bool may_send(std::int64_t now) { return !fastest_ || fresh(now); }
  /// Notes a command on the driver's channel. Nothing throws: LCM calls it.
  void hear_command(const void* data, std::size_t size) noexcept;
  /// True if somebody else commands beside this session, which must then end.
  bool rivalled() const noexcept;
  /// Notes a command that was sent, to recognise it when it is heard.
  void note_sent(const std::vector<std::uint8_t>& bytes, double latency);

  /// The arm stops, and then the torque fades to zero.
  void end() noexcept;
  bool ended() const noexcept { return ended_; }
  /// The longest time that end() takes, s.
  double end_time() const noexcept;
  /// Why the robot needs its own brakes, after the last command was sent; "": it does not.
  const std::string& engaged() const noexcept { return engaged_; }

  bool running() const noexcept { return running_; }
  /// One line that the user should see at once; "" if there is nothing new.
  std::string warning();

  DriveRecord record;

 private:
  void note_age(std::int64_t utime, std::int64_t interval, std::int64_t arrived, std::int64_t now);
  /// True if the status that was taken may be answered; otherwise it counts as late. Throws
  /// std::runtime_error if all statuses were late for long.
  bool fresh(std::int64_t now);
  double age(std::int64_t now) const noexcept;  ///< of the status that was taken, s
  void note_repeated(const lcmtypes::DriverStatus& status);
  void fade(std::int64_t utime);
  bool stands(std::int64_t utime);
  void note_fault(std::int32_t code);
  void engage(std::int32_t code, lcmtypes::DriverCommand& command);
  void watch(const lcmtypes::DriverStatus& status, bool late);
  void begin(const lcmtypes::DriverStatus& status);
  void check_period();
  void check_springs();
  void note_external(const lcmtypes::DriverStatus& status);
  bool stopped_by_itself(const lcmtypes::DriverStatus& status) const noexcept;

  const controller::Config& config_;
  LoopController& controller_;
  LoopGoal& goal_;
  LoopJournal& journal_;
  Options options_;
  const lcmtypes::DriverProfile& profile_;
  int n_;
  bool running_ = false;
  bool foreign_ = false;                 ///< somebody else's command was heard
  std::int64_t first_ = 0, last_ = 0;    ///< utime of the statuses
  std::vector<std::int64_t> intervals_;  ///< before the start, us
  JointVector first_position_, first_commanded_;
  bool moved_ = false;        ///< the measured position has changed since first_position_
  bool recommanded_ = false;  ///< the driver has commanded another position
  JointVector last_position_;
  std::int64_t measured_at_ = 0;  ///< utime of last_position_
  std::int64_t repeated_ = 0;     ///< old statuses since the last new one
  std::int64_t sent_at_ = 0;      ///< latest time at which the status taken may have been sent, us
  /// The shortest time from a status's utime, a time of day, until it was taken, us.
  std::optional<std::int64_t> fastest_;
  std::int64_t lates_ = 0;        ///< since the last status that was not late
  bool restarted_ = false;        ///< the driver's clock was not known while this ran
  std::int64_t quiet_until_ = 0;  ///< utime of the first status to be answered again
  bool ending_ = false, ended_ = false;
  dashpot_modes modes_{};  ///< of the springs, before the end
  std::int64_t fade_;      ///< us
  std::optional<std::int64_t> stopping_since_, fading_since_;
  std::int64_t seen_at_ = 0;        ///< while the arm stops: utime of seen_
  JointVector seen_;                ///< position then
  std::int64_t faults_ = 0;         ///< so far
  std::int32_t told_ = DASHPOT_OK;  ///< the worst status since the fault that was reported
  std::string engaged_;
  JointVector torque_;
  std::deque<std::vector<std::uint8_t>> sent_;  ///< the last ones
  std::string warning_;
  bool warned_external_ = false;
};

/// The summary of `dashpot drive`.
struct DriveReport {
  std::string config;  ///< the file
  lcmtypes::DriverKind driver = lcmtypes::DriverKind::kIiwa;
  bool dry_run = false;
  bool running = false;  ///< the conversation has begun
  std::string ended;     ///< why, in one line
  DriveRecord drive;
  LoopRecord loop;
  lcmtypes::PublisherCounters messages;
  std::optional<CommandReport> commands;     ///< if commands were enabled
  std::optional<IdentifyReport> identified;  ///< from the motion after an excitation
};

/// For people: lines, each ended by a newline.
std::string to_table(const DriveReport& report);
/// One JSON object. docs/drive.md lists the keys.
std::string to_json(const DriveReport& report);

}  // namespace dashpot::apps
