#pragma once
#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/vibration.hpp>

#include <atomic>
#include <thread>

namespace dashpot::controller {

/// A thread that solves the latest task. The real-time thread hands tasks over and fetches results
/// without waiting, locking or calling the system; so nobody wakes this thread: it looks for tasks
/// every 200 us.
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

 private:
  void run() noexcept;

  VibrationSolver solver_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  ///< the last member: it uses the others
};

}  // namespace dashpot::controller
