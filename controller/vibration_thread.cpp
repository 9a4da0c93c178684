#include <dashpot/controller/vibration_thread.hpp>

#include <pthread.h>
#include <sched.h>
#include <chrono>

namespace dashpot::controller {

VibrationThread::VibrationThread(const Analysis& settings)
    : solver_(settings), thread_([this] { run(); }) {}

VibrationThread::~VibrationThread() {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
}

void VibrationThread::run() noexcept {
  // Whoever made the controller may be a real-time thread; this one must not delay it.
  const sched_param ordinary{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
  std::uint64_t resets = 0;
  while (!stop_.load(std::memory_order_relaxed)) {
    if (!tasks.fetch()) {
      std::this_thread::sleep_for(std::chrono::microseconds(200));
      continue;
    }
    const VibrationTask& task = tasks.value();
    if (task.resets != resets) solver_.reset();
    resets = task.resets;
    Result& result = results.slot();
    solver_.solve(task, result.vibration);
    result.resets = resets;
    results.publish();
  }
}

}  // namespace dashpot::controller
