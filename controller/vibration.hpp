#pragma once
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/snapshot.hpp>

#include <memory>

namespace dashpot::controller {

/// One tick to be analysed.
struct VibrationTask {
  std::int64_t time = 0;
  std::uint64_t tick = 0;
  JointVector position;
  analysis::System<kMaxJoints> system;  ///< the closed loop; see LoopSystem
  bool springs = true;                  ///< there is a stiffness at all
  std::uint64_t number = 0;             ///< of tasks so far, this one included
  std::uint64_t restarts = 0;  ///< of tasks so far that were to be solved anew, this one included
  std::uint64_t resets = 0;    ///< results of before a reset are not wanted
  VibrationCounters counters;  ///< those of the ticks that were not even tasks, or in part
};

/// Finds the modes of one task after the other, each from those before.
class VibrationSolver {
 public:
  explicit VibrationSolver(const Analysis& settings);
  /// No more work than is granted, no allocation, no system call. Returns false, with the result as
  /// it was, if that is not enough: the task then counts when it is solved. Forgets the past where
  /// the task is the first one after a reset.
  bool solve(const VibrationTask& task, Vibration& result, analysis::Work& work) noexcept;
  void solve(const VibrationTask& task, Vibration& result) noexcept {
    analysis::Work unlimited;
    solve(task, result, unlimited);
  }
  /// True if the next task starts from the last one.
  bool follows() const noexcept { return tracker_.follows(); }

 private:
  void reset() noexcept;
  void publish_modes(Vibration& result) const noexcept;

  bool shapes_;
  analysis::ModeTracker tracker_;
  analysis::TrackedSpectrum spectrum_;
  VibrationCounters counters_;
  std::uint64_t solved_ = 0, restarted_ = 0, resets_ = 0;  ///< numbers of the last task
  /// Of the tracker at the last reset: shapes left out, and updates of proportional damping.
  std::uint64_t skipped_ = 0, proportional_ = 0;
};

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
  /// The next update is to be solved anew: what real eigenvalues form a mode depends on the way
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
