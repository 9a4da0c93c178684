#pragma once
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/vibration/vibration_solver.hpp>

#include <condition_variable>
#include <mutex>
#include <thread>

namespace dashpot::controller {

/// A thread that solves the latest task. The real-time thread hands tasks over and fetches results
/// without waiting, locking or calling the system; so nobody wakes this thread: it looks for tasks
/// every 200 us, or every 2 ms if there was none for some time.
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
  Latest<Result> results;       ///< back
  /// Of this thread from a task's publication to its result's; before and after, while there is no
  /// other task, the real-time thread may use it.
  VibrationSolver solver;

 private:
  void run() noexcept;

  std::mutex mutex_;  ///< of what follows; the real-time thread has nothing to do with it
  std::condition_variable stopped_;
  bool stop_ = false;
  std::thread thread_;  ///< the last member: it uses the others
};

}  // namespace dashpot::controller
