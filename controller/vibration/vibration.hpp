#pragma once
#include <dashpot/controller/vibration/vibration_solver.hpp>

#include <memory>

namespace dashpot::controller {

class VibrationThread;

/// Finds the vibration modes of the closed loop: within the tick, on a thread of its own, or not at
/// all. All memory is set aside, and the thread started, at set-up.
///
/// Within the tick no more work is done than Settings::Analysis::share grants. A task that needs
/// more goes to the thread, with all that is known of the modes: until it is solved the status is
/// analysis::Status::kUnfinished, then the modes are those of that task's tick, and the next tick
/// goes on from them if they can be followed. Where they cannot, tasks go straight to the thread,
/// and solving one within the tick is tried more and more seldom.
///
/// Where no modes are found the result's status says why, its count is zero, and nothing else is
/// affected. Results on the thread have the same numbers as those within the tick as long as it
/// keeps up; where it missed some, eigenvalues that agree within the proved bounds. (Which of two
/// real ones form a mode may then differ, where several modes are overdamped, until gains change.)
class VibrationAnalysis {
 public:
  explicit VibrationAnalysis(const Settings& settings);
  ~VibrationAnalysis();
  VibrationAnalysis(const VibrationAnalysis&) = delete;
  VibrationAnalysis& operator=(const VibrationAnalysis&) = delete;

  /// Whether this tick (counted from 1) is one to analyse.
  bool due(std::uint64_t tick) const noexcept { return every_ != 0 && (tick - 1) % every_ == 0; }
  /// Where the caller puts all but numbers and counters before `update`.
  VibrationTask& task() noexcept;
  /// Of the ticks that the caller knows to need less.
  VibrationCounters& counters() noexcept { return counters_; }
  void update() noexcept;
  /// The next update is to be solved directly: what real eigenvalues form a mode depends on the way
  /// there, and should not on that of the gains.
  void restart() noexcept { ++restarts_; }
  /// Instead of `task` and `update`, for a tick whose closed loop is exactly that of the last one.
  void repeat(std::int64_t time, std::uint64_t tick) noexcept;
  /// Fetches what the thread has found.
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
  std::unique_ptr<VibrationThread> thread_;  ///< none where there is nothing to analyse
  const Vibration* shown_ = &result_;

  // Of tasks within the tick:
  bool away_ = false;         ///< the thread has one, and the solver with it
  bool missed_ = false;       ///< the last one came meanwhile
  bool from_thread_ = false;  ///< the thread solved what is shown, and none was solved since
  std::uint64_t tried_restarts_ = 0;  ///< of the last one that was tried
  int wait_ = 0, next_wait_ = 0;      ///< tasks until one is tried again, now and the next time
};

}  // namespace dashpot::controller
