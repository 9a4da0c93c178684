#pragma once
#include <dashpot/controller/latest.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/command_filter.hpp>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

namespace dashpot::lcmtypes {

/// Receives commands from a bus on a thread of its own, and keeps what the accepted ones have set
/// for the real-time thread. Any other message changes only counters.
class CommandReceiver {
 public:
  /// Handles all messages of `bus` from now on; no other code may handle them. `take` is called on
  /// the receiver's thread. Throws std::invalid_argument for bad limits, std::runtime_error if it
  /// cannot subscribe.
  CommandReceiver(std::shared_ptr<lcm::LCM> bus, const CommandLimits& limits,
                  CommandTaker take = {});
  ~CommandReceiver();
  CommandReceiver(const CommandReceiver&) = delete;
  CommandReceiver& operator=(const CommandReceiver&) = delete;

  // For the real-time thread only; none of these functions ever waits.
  /// Returns true if commands were accepted since the last call; `command()` then returns what all
  /// accepted commands have set so far.
  bool fetch() noexcept { return newest_.fetch(); }
  const Command& command() const noexcept { return newest_.value(); }
  /// Fetches and returns the verdicts of the commands that have arrived.
  const CommandTally& fetch_tally() noexcept {
    tallies_.fetch();
    return tallies_.value();
  }
  /// Sets the fault that commands may release from now on, by the tick at which it latched; 0:
  /// none.
  void set_fault_tick(std::int64_t tick) noexcept {
    fault_tick_.store(tick, std::memory_order_relaxed);
  }

  // For other threads; the receiver's thread may have to wait meanwhile.
  CommandTally tally() const;
  /// Returns why the last refused command was refused, in one line; "" if none was refused.
  std::string last_reason() const;

 private:
  struct Subscription;
  void run();
  /// Copies the filter's tally for the other threads.
  void show_tally();

  std::shared_ptr<lcm::LCM> bus_;
  CommandFilter filter_;
  controller::Latest<Command> newest_;
  controller::Latest<CommandTally> tallies_;
  mutable std::mutex mutex_;  ///< guards the next two
  CommandTally tally_;
  std::string last_reason_;
  std::atomic<std::int64_t> fault_tick_{0};
  std::atomic<bool> stop_{false};
  std::unique_ptr<Subscription> subscription_;
  std::thread thread_;
};

}  // namespace dashpot::lcmtypes
