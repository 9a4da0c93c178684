#pragma once
#include <dashpot/apps/loop/command_source.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/sim/step_status.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace dashpot::apps {

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

}  // namespace dashpot::apps
