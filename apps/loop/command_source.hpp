#pragma once
#include <dashpot/apps/loop/loop_goal.hpp>
#include <dashpot/lcmtypes/command_receiver.hpp>

#include <cstdint>
#include <memory>
#include <string>

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

}  // namespace dashpot::apps
