#pragma once
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/snapshot.hpp>

namespace dashpot::controller {

/// One tick to be analysed.
struct VibrationTask {
  std::int64_t time = 0;
  std::uint64_t tick = 0;
  JointVector position;
  analysis::System<kMaxJoints> system;  ///< the closed loop; see LoopSystem
  bool springs = true;                  ///< whether there is any stiffness
  std::uint64_t number = 0;             ///< of this task, counted from 1
  std::uint64_t restarts = 0;           ///< direct solutions asked for so far
  std::uint64_t resets = 0;             ///< resets so far; earlier results are dropped
  VibrationCounters counters;           ///< of ticks that needed only a part of a task, or none
};

/// Finds the modes of one task after the other, each from the modes of the task before.
class VibrationSolver {
 public:
  explicit VibrationSolver(const Analysis& settings);
  /// Solves a task with no more work than `work` grants, without allocation or system call. Returns
  /// false and leaves `result` as it was if that is not enough; the task is then counted when it is
  /// solved. Forgets the past if the task is the first one after a reset.
  bool solve(const VibrationTask& task, Vibration& result, analysis::Work& work) noexcept;
  void solve(const VibrationTask& task, Vibration& result) noexcept {
    analysis::Work unlimited;
    solve(task, result, unlimited);
  }
  /// Returns true if the next task starts from the modes of the last one.
  bool follows() const noexcept { return tracker_.follows(); }

 private:
  void reset() noexcept;
  void publish_modes(Vibration& result) const noexcept;

  bool shapes_;
  analysis::ModeTracker tracker_;
  analysis::TrackedSpectrum spectrum_;
  VibrationCounters counters_;
  std::uint64_t solved_ = 0, restarted_ = 0, resets_ = 0;  ///< numbers of the last task
};

}  // namespace dashpot::controller
