#pragma once
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/vibration/vibration_solver.hpp>

#include <condition_variable>
#include <mutex>
#include <thread>

namespace dashpot::controller {

/// A thread that solves the latest task. The real-time thread hands tasks over and fetches results
/// without waiting, locking or calling the system. It does not wake this thread, which looks for
/// tasks every 200 us, or every 2 ms if there was none for some time.
class VibrationThread {
 public:
  struct Result {
    Vibration vibration;
    std::uint64_t resets = 0;
  };

  explicit VibrationThread(const Analysis& settings);
  ~VibrationThread();
  VibrationThread(const VibrationThread&) = delete;
  VibrationThread& operator=(const VibrationThread&) = delete;

  Latest<VibrationTask> tasks;  ///< from the real-time thread
  Latest<Result> results;       ///< to the real-time thread
  /// Belongs to this thread from the publication of a task to the publication of its result. While
  /// there is no task, the real-time thread may use it.
  VibrationSolver solver;

 private:
  void run() noexcept;

  std::mutex mutex_;  ///< guards stop_; the real-time thread does not use it
  std::condition_variable stopped_;
  bool stop_ = false;
  std::thread thread_;  ///< the last member: it uses the others
};

}  // namespace dashpot::controller
