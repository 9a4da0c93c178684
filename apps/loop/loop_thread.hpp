#pragma once
#include <dashpot/apps/loop/loop_journal.hpp>
#include <dashpot/apps/loop/simulated_loop.hpp>

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

namespace dashpot::apps {

/// Rights that the operating system granted to a loop in real time.
struct Privileges {
  bool scheduled = false;  ///< SCHED_FIFO
  bool locked = false;     ///< all memory stays resident
};

/// Locks all memory, now and to come, unless the limit on it could stop the program later.
bool lock_memory() noexcept;
/// Schedules the calling thread ahead of others.
bool schedule_ahead_of_others() noexcept;

using Pace = LoopJournal::Pace;

/// Runs a closed loop on a thread of its own until it has made its ticks, the simulation fails or
/// stop() is called. In real time ticks begin at absolute deadlines; a deadline that lies more
/// than a tick back is skipped, and counted as an overrun. The loop allocates nothing, and waits
/// for nothing but its deadlines: the gains of the scenario are left to another thread, which calls
/// ClosedLoop::follow_gains. Only without real time it has them judged and publishes on its own
/// thread, so that no message is lost, and waits for modes that a background thread still solves,
/// so that they do not depend on the speed of the machine.
class LoopThread {
 public:
  struct Options {
    Pace pace = Pace::kRealTime;
    double period = 0.001;  ///< s
    std::int64_t ticks = 0;
  };

  /// `commands` may be null: no commands. All must outlive it. In real time the publisher's thread
  /// runs already.
  LoopThread(ClosedLoop& loop, lcmtypes::Publisher& publisher, CommandSource* commands,
             const Options& options);
  ~LoopThread();
  LoopThread(const LoopThread&) = delete;
  LoopThread& operator=(const LoopThread&) = delete;

  void start();
  /// The loop ends with its next tick.
  void stop() noexcept { stop_ = true; }
  bool done() const noexcept { return done_; }
  void join();

  // While it runs:
  std::int64_t ticks() const noexcept { return ticks_; }
  std::int64_t overruns() const noexcept { return overruns_; }

  // After join():
  const LoopRecord& record() const noexcept { return journal_.record; }
  const Privileges& privileges() const noexcept { return privileges_; }

 private:
  void run() noexcept;
  void tick(std::int64_t utime) noexcept;

  ClosedLoop& loop_;
  lcmtypes::Publisher& publisher_;
  Options options_;
  std::thread thread_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> done_{false};
  std::atomic<std::int64_t> ticks_{0};
  std::atomic<std::int64_t> overruns_{0};
  Privileges privileges_;

  LoopJournal journal_;  // the loop's own
};

}  // namespace dashpot::apps
