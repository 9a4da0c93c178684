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
  bool springs = true;                  ///< there is a stiffness at all
  std::uint64_t number = 0;             ///< of tasks so far, this one included
  std::uint64_t restarts =
      0;                     ///< of tasks so far that were to be solved directly, this one included
  std::uint64_t resets = 0;  ///< results of before a reset are not wanted
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

}  // namespace dashpot::controller
