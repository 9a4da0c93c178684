#pragma once
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/snapshot.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>

#include <atomic>
#include <thread>
#include <vector>

namespace dashpot::controller {

/// Finds, at intervals and on a thread of its own, the modes of the loop with its torque held over
/// a period (zero-order hold), delayed and filtered, by analysis::sample_loop and
/// analysis::gain_margin. The thread is needed because this takes milliseconds and allocates.
///
/// The real-time thread calls `due`, `task`, `hand_over` and `reset`. One other thread, always the
/// same, calls `latest`. None of these functions waits, allocates or calls the system.
class SampledAnalysis {
 public:
  /// A closed loop, as Controller::closed_loop sets it.
  struct Task {
    std::int64_t time = 0;
    std::uint64_t tick = 0;
    std::uint64_t resets = 0;  ///< filled in by `hand_over`
    JointVector position;
    analysis::System<kMaxJoints> system;
    PassivePart passive;   ///< of the surroundings
    JointMatrix integral;  ///< K_I of integral_stiffness; empty: none
    Attachment attachment;
  };

  SampledAnalysis(const RobotModel& model, const Settings& settings);
  ~SampledAnalysis();
  SampledAnalysis(const SampledAnalysis&) = delete;
  SampledAnalysis& operator=(const SampledAnalysis&) = delete;

  /// Returns true if it is time for the next task: once the gains have grown, and then at each
  /// interval. Ticks count from 1, and begin again after `reset`.
  bool due(std::uint64_t tick) const noexcept { return tick >= next_; }
  /// Returns the task that the caller fills in, and then hands over.
  Task& task() noexcept { return tasks_.slot(); }
  void hand_over() noexcept;
  void reset() noexcept;

  /// Returns the latest result; null as long as there is none since the last `reset`. The result is
  /// valid until the next call.
  const SampledVibration* latest() noexcept;

 private:
  void run() noexcept;
  void solve(const Task& task, SampledVibration& result);

  SampledArm arm_;
  std::uint64_t interval_;
  std::uint64_t first_;  ///< tick
  std::uint64_t next_;
  std::atomic<std::uint64_t> resets_{1};  ///< from 1, so that an empty result never matches
  Latest<Task> tasks_;
  Latest<SampledVibration> results_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  ///< the last member: it uses the others
};

}  // namespace dashpot::controller
