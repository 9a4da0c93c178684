#pragma once
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/snapshot.hpp>

#include <atomic>
#include <thread>

namespace dashpot::controller {

/// dg/dq (n x n, N m/rad) of the gravity torque g(q), by central differences, good to 1e-9
/// relative. Allocates.
Eigen::MatrixXd gravity_gradient(const RobotModel& model, const JointVector& q);

/// The loop as the settings describe it, without gravity.
analysis::SampledLoop sampled_loop(const RobotModel& model, const Settings& settings);

/// Finds, now and then and on a thread of its own, what becomes of the modes because the torque is
/// held over a tick, delayed and filtered: analysis::sample_loop, and analysis::gain_margin. That
/// takes milliseconds and allocates.
///
/// The real-time thread calls `due`, `task`, `hand_over` and `reset`; one other thread, always the
/// same, `latest`. None of these waits, allocates or calls the system.
class SampledAnalysis {
 public:
  /// A closed loop as Controller::closed_loop gives it.
  struct Task {
    std::int64_t time = 0;
    std::uint64_t tick = 0;
    std::uint64_t resets = 0;  ///< filled in by `hand_over`
    JointVector position;
    analysis::System<kMaxJoints> system;
  };

  SampledAnalysis(const RobotModel& model, const Settings& settings);
  ~SampledAnalysis();
  SampledAnalysis(const SampledAnalysis&) = delete;
  SampledAnalysis& operator=(const SampledAnalysis&) = delete;

  /// Whether it is time for the next task: once the gains have grown, and then at each interval.
  /// Ticks count from 1, and begin again after `reset`.
  bool due(std::uint64_t tick) const noexcept { return tick >= next_; }
  /// To be filled in, and then handed over.
  Task& task() noexcept { return tasks_.slot(); }
  void hand_over() noexcept;
  void reset() noexcept;

  /// The latest result; null as long as there is none since the last `reset`. Good until the next
  /// call.
  const SampledVibration* latest() noexcept;

 private:
  void run() noexcept;
  void solve(const Task& task, SampledVibration& result);

  RobotModel model_;
  bool gravity_;  ///< is compensated
  std::uint64_t interval_;
  std::uint64_t first_;  ///< tick
  std::uint64_t next_;
  std::atomic<std::uint64_t> resets_{1};  ///< so that a result that is none does not fit
  analysis::SampledLoop loop_;            ///< the thread's
  Latest<Task> tasks_;
  Latest<SampledVibration> results_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  ///< the last member: it uses the others
};

}  // namespace dashpot::controller
