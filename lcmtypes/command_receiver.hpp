#pragma once
#include <dashpot/controller/latest.hpp>
#include <dashpot/lcmtypes/bus.hpp>
#include <dashpot/lcmtypes/command_filter.hpp>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>

namespace dashpot::lcmtypes {

/// Takes commands from a bus on a thread of its own, and keeps the last good state of affairs for
/// the real-time thread. Whatever else arrives, or if nothing does, only counters change.
class CommandReceiver {
 public:
  /// Handles all messages of `bus` from now on: nobody else may. Throws std::invalid_argument for
  /// bad limits, std::runtime_error if it cannot subscribe.
  CommandReceiver(std::shared_ptr<lcm::LCM> bus, const CommandLimits& limits);
  ~CommandReceiver();
  CommandReceiver(const CommandReceiver&) = delete;
  CommandReceiver& operator=(const CommandReceiver&) = delete;

  /// Real-time thread only, never waits: whether commands were accepted since the last call; then
  /// `command()` says what they have set so far.
  bool fetch() noexcept { return newest_.fetch(); }
  const Command& command() const noexcept { return newest_.value(); }

  /// Any thread: how many messages got this verdict, and all but kAccepted.
  std::int64_t count(CommandVerdict verdict) const noexcept;
  std::int64_t rejected() const noexcept;

 private:
  struct Subscription;
  void run();

  std::shared_ptr<lcm::LCM> bus_;
  CommandFilter filter_;
  controller::Latest<Command> newest_;
  std::array<std::atomic<std::int64_t>, kCommandVerdicts> counts_{};
  std::atomic<bool> stop_{false};
  std::unique_ptr<Subscription> subscription_;
  std::thread thread_;
};

}  // namespace dashpot::lcmtypes
