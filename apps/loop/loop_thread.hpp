#pragma once
#include <dashpot/apps/loop/command_source.hpp>
#include <dashpot/lcmtypes/publisher.hpp>

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

namespace dashpot::apps {

enum class Pace { kRealTime, kFast };

/// What the operating system granted to a loop in real time.
struct Privileges {
  bool scheduled = false;  ///< SCHED_FIFO
  bool locked = false;     ///< all memory stays resident
};

/// What a loop saw while it ran.
struct LoopRecord {
  std::int64_t ticks = 0;
  std::int64_t overruns = 0;        ///< ticks that ended after their period
  std::int64_t own_overruns = 0;    ///< of these, where the loop itself computed longer than that
  std::int64_t latest_wake_up = 0;  ///< after its deadline, ns
  std::vector<std::int32_t> tick_times;     ///< of the controller, ns
  std::array<std::int64_t, 32> statuses{};  ///< ticks with each status of the controller
  std::int64_t status_changes = 0;
  std::uint64_t restarts = 0;  ///< of the springs, after the first tick
  sim::Status simulation = sim::Status::kOk;
  std::int64_t commands_refused = 0;  ///< by the controller, though accepted
  std::int64_t faults = 0;            ///< how often one latched
  std::int32_t fault = DASHPOT_OK;    ///< that is latched; DASHPOT_OK: none
  std::int64_t fault_tick = 0;        ///< when it latched; 0: there is none
  dashpot_modes first_modes{};        ///< tick 0: there were none
  dashpot_modes last_modes{};
  bool cartesian = false;  ///< Cartesian springs were in force
  bool joint = false;      ///< joint springs were in force
  // The largest distances between where these springs are fixed and where the robot is:
  double tip_error = 0;        ///< m
  double tip_angle_error = 0;  ///< rad
  double joint_error = 0;      ///< rad
};

/// Runs a closed loop on a thread of its own until it has made its ticks, the simulation fails or
/// somebody stops it. In real time ticks begin at absolute deadlines; a deadline that lies more
/// than a tick back is given up, and counted as an overrun. The loop allocates nothing, and waits
/// for nothing but its deadlines: the gains of the scenario are left to another thread, which calls
/// ClosedLoop::follow_gains. Only without real time it has them judged and publishes on its own
/// thread, so that no message is lost.
class LoopThread {
 public:
  struct Options {
    Pace pace = Pace::kRealTime;
    double period = 0.001;  ///< s
    std::int64_t ticks = 0;
  };

  /// `commands` may be null: none are taken. All must outlive it. In real time the publisher's
  /// thread runs already.
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
  const LoopRecord& record() const noexcept { return record_; }
  const Privileges& privileges() const noexcept { return privileges_; }

 private:
  void run() noexcept;
  void tick(std::int64_t utime) noexcept;
  void note_fault(const dashpot_snapshot& snapshot) noexcept;
  void note(const dashpot_snapshot& snapshot) noexcept;
  void publish(std::int64_t utime) noexcept;
  void publish_sampled(std::int64_t utime, std::int64_t time) noexcept;

  ClosedLoop& loop_;
  lcmtypes::Publisher& publisher_;
  CommandSource* commands_;
  Options options_;
  std::thread thread_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> done_{false};
  std::atomic<std::int64_t> ticks_{0};
  std::atomic<std::int64_t> overruns_{0};
  Privileges privileges_;

  // The loop's own:
  LoopRecord record_;
  bool released_ = false;  ///< this tick takes up the release of a fault
  std::int32_t last_status_ = DASHPOT_OK;
  std::uint64_t first_restarts_ = 0;
  lcmtypes::StateSample state_;
  lcmtypes::ModesSample modes_;
  lcmtypes::SampledModesSample sampled_;
};

}  // namespace dashpot::apps
