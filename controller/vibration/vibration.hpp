#pragma once
#include <dashpot/controller/vibration/vibration_solver.hpp>

#include <memory>

namespace dashpot::controller {

class VibrationThread;

/// Finds the vibration modes of the closed loop: within the tick, on a thread of its own, or not at
/// all. All memory is set aside, and the thread started, at set-up.
///
/// Within the tick no more work is done than Analysis::share grants. A task that needs more goes to
/// the thread, with all that is known of the modes. Until it is solved the status is
/// analysis::Status::kUnfinished. Then the result has the modes of the task's tick, and the next
/// tick continues from them if they can be tracked. If they cannot, tasks go straight to the
/// thread, and solving one within the tick is tried more and more seldom.
///
/// If no modes are found, the result's status says why, its count is zero, and nothing else is
/// affected. Results of the thread have the same numbers as results within the tick as long as the
/// thread keeps up. If it missed tasks, eigenvalues agree within the proved bounds. (Where several
/// modes are overdamped, it may then differ which two real eigenvalues form a mode, until gains
/// change.)
class VibrationAnalysis {
 public:
  /// Analyses systems with this number of coordinates.
  VibrationAnalysis(const Settings& settings, int coordinates);
  ~VibrationAnalysis();
  VibrationAnalysis(const VibrationAnalysis&) = delete;
  VibrationAnalysis& operator=(const VibrationAnalysis&) = delete;

  /// Returns true if this tick (counted from 1) is to be analysed.
  bool due(std::uint64_t tick) const noexcept { return every_ != 0 && (tick - 1) % every_ == 0; }
  /// Returns the task, of which the caller sets all but numbers and counters before `update`.
  VibrationTask& task() noexcept;
  /// Returns the counters of ticks that need less, which the caller increases.
  VibrationCounters& counters() noexcept { return counters_; }
  /// Analyses the task within the tick, or hands it to the thread.
  void update() noexcept;
  /// Makes the next update solve directly, because which real eigenvalues form a mode depends on
  /// the previous modes, and should not depend on previous gains.
  void restart() noexcept { ++restarts_; }
  /// Takes the place of `task` and `update` in a tick whose closed loop is exactly the last one.
  void repeat(std::int64_t time, std::uint64_t tick) noexcept;
  /// Fetches the thread's latest result.
  void collect() noexcept;
  void reset(Eigen::Index n) noexcept;
  const Vibration& result() const noexcept { return *shown_; }

 private:
  bool worth_trying(const VibrationTask& given) noexcept;
  void try_within_tick(const VibrationTask& given) noexcept;
  void announce(const VibrationTask& given) noexcept;

  std::uint64_t every_;  ///< 0: never
  bool background_;
  std::int64_t budget_;  ///< units of Work in a tick
  std::uint64_t tasks_ = 0, restarts_ = 0, resets_ = 0;
  VibrationCounters counters_;
  Vibration result_;
  std::unique_ptr<VibrationThread> thread_;  ///< null if nothing is to be analysed
  const Vibration* shown_ = &result_;

  // State of tasks within the tick:
  bool away_ = false;         ///< the thread has a task, and the solver with it
  bool missed_ = false;       ///< the last task came meanwhile
  bool from_thread_ = false;  ///< the thread solved the result, and no task was solved since
  std::uint64_t tried_restarts_ = 0;  ///< `restarts` of the last task that was tried
  int wait_ = 0, next_wait_ = 0;      ///< tasks until one is tried again, now and next time
};

}  // namespace dashpot::controller
