#pragma once
#include <dashpot/apps/loop/loop_goal.hpp>
#include <dashpot/lcmtypes/command_receiver.hpp>
#include <dashpot/lcmtypes/command_verdict.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/sim/step_status.hpp>

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace dashpot::apps {

/// Listens for a moment, and throws InputError if another loop publishes its states on the bus:
/// both would take each command.
void refuse_second_loop(const std::shared_ptr<lcm::LCM>& bus);

/// Takes commands for a loop from a bus. Gains, payload, tool, speeds and releases go to the
/// controller on the receiver's thread, because judging them may take milliseconds; if it refuses
/// one, the whole command is refused. The rest goes to the loop's thread.
class CommandSource {
 public:
  /// `goal` must outlive it. Otherwise as CommandReceiver.
  CommandSource(std::shared_ptr<lcm::LCM> bus, const lcmtypes::CommandLimits& limits,
                LoopGoal& goal);

  // The loop's thread; none of these ever waits.
  /// Before a tick: sets the loop's goal. True if a fault is released with this tick.
  bool take() noexcept;
  /// Whether this tick's set-point was commanded.
  bool taken() const noexcept { return taken_; }
  const lcmtypes::CommandTally& fetch_tally() noexcept { return receiver_.fetch_tally(); }
  /// The fault that commands may release from now on, by the tick at which it latched; 0: none.
  void set_fault_tick(std::int64_t tick) noexcept { receiver_.set_fault_tick(tick); }

  // Other threads.
  lcmtypes::CommandTally tally() const { return receiver_.tally(); }
  std::string last_reason() const { return receiver_.last_reason(); }

 private:
  LoopGoal& goal_;
  std::int64_t commands_ = 0;  ///< accepted ones passed on to the loop
  bool taken_ = false;
  lcmtypes::CommandReceiver receiver_;
};

/// Counts and extremes of a loop while it ran.
struct LoopRecord {
  std::int64_t ticks = 0;
  std::int64_t overruns = 0;                ///< ticks that ended after their period
  std::int64_t own_overruns = 0;            ///< of these, with more than a period of computing time
  std::int64_t latest_wake_up = 0;          ///< after its deadline, ns
  std::vector<std::int32_t> tick_times;     ///< of the controller, ns
  std::array<std::int64_t, 32> statuses{};  ///< ticks with each status of the controller
  std::int64_t status_changes = 0;
  std::uint64_t restarts = 0;  ///< of the springs, after the first tick
  sim::Status simulation = sim::Status::kOk;
  std::int64_t commands_refused = 0;  ///< accepted, then refused by the controller
  std::int64_t faults = 0;            ///< how often one latched
  std::int32_t fault = DASHPOT_OK;    ///< latched fault; DASHPOT_OK: none
  std::int64_t fault_tick = 0;        ///< when it latched; 0: there is none
  dashpot_modes first_modes{};        ///< the first that were found; tick 0: none were
  dashpot_modes last_modes{};         ///< the last that were found
  bool cartesian = false;             ///< Cartesian springs were active
  bool joint = false;                 ///< joint springs were active
  // The largest distances between the reference of these springs and the robot:
  double tip_error = 0;        ///< m
  double tip_angle_error = 0;  ///< rad
  double joint_error = 0;      ///< rad
  double damping_level = 1;    ///< the least one, see dashpot_snapshot
};

/// Keeps the record of a loop, tick by tick, and offers its messages to the publisher. The loop's
/// thread calls it; nothing here allocates or waits.
class LoopJournal {
 public:
  /// Which messages are published in addition to the states.
  enum class Pace { kRealTime, kFast };

  /// `commands` may be null: no commands. All must outlive it.
  LoopJournal(LoopController& controller, LoopGoal& goal, lcmtypes::Publisher& publisher,
              CommandSource* commands, Pace pace);

  /// Keeps the computing times of so many ticks. Before the loop begins.
  void keep_times(std::int64_t ticks);
  /// Before a tick: takes commands.
  void begin_tick() noexcept;
  /// The force of a contact on the tip at this tick, N, if it is known. Before note_tick().
  void note_contact(const std::optional<Eigen::Vector3d>& force) noexcept {
    state_.contact_force = force;
  }
  /// After a tick at `utime`, us since 1970-01-01 UTC, that computed for `tick_time` ns, before it
  /// counts. `overran`: it ended after its period.
  void note_tick(std::int64_t utime, std::int32_t status, std::int32_t tick_time) noexcept;
  /// True while the background thread still solves the modes of an earlier tick.
  bool awaits_modes() const noexcept { return awaits_modes_; }
  /// The tick is over.
  void end_tick() noexcept { ++record.ticks; }

  LoopRecord record;

 private:
  void note_fault(const dashpot_snapshot& snapshot) noexcept;
  void note_errors(const dashpot_snapshot& snapshot) noexcept;
  void publish(std::int64_t utime) noexcept;
  void publish_sampled(std::int64_t utime, std::int64_t time) noexcept;

  LoopController& controller_;
  LoopGoal& goal_;
  lcmtypes::Publisher& publisher_;
  CommandSource* commands_;
  Pace pace_;
  bool awaits_modes_ = false;
  bool released_ = false;  ///< this tick takes up the release of a fault
  std::int32_t last_status_ = DASHPOT_OK;
  std::uint64_t first_restarts_ = 0;
  lcmtypes::StateSample state_;
  lcmtypes::ModesSample modes_;
  lcmtypes::SampledModesSample sampled_;
};

/// The results of the commands of a run.
struct CommandReport {
  lcmtypes::CommandTally tally;
  std::string last_reason;  ///< of the last rejection
};

/// "3 accepted, 2 rejected (1 too old, 1 not finite)", of state_t::verdicts.
std::string verdicts_text(std::span<const std::int64_t> verdicts);

/// For people: lines that begin with two spaces. `report` without a value: commands were disabled;
/// `refused`: accepted commands that the controller refused.
std::string commands_text(const std::optional<CommandReport>& report, std::int64_t refused);
std::string fault_text(const LoopRecord& loop);

nlohmann::ordered_json commands_json(const std::optional<CommandReport>& report,
                                     std::int64_t refused);
/// Throws std::runtime_error if a fault is latched at the end, so that the exit status shows it.
void refuse_latched_fault(const LoopRecord& loop);
/// null if no fault is latched at the end
nlohmann::ordered_json fault_json(const LoopRecord& loop);

}  // namespace dashpot::apps
