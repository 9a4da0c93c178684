#include <dashpot/controller/vibration/vibration_thread.hpp>

#include <pthread.h>
#include <sched.h>
#include <algorithm>
#include <chrono>

namespace dashpot::controller {

VibrationThread::VibrationThread(const Analysis& settings)
    : solver(settings), thread_([this] { run(); }) {}

VibrationThread::~VibrationThread() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  stopped_.notify_one();
  thread_.join();
}

void VibrationThread::run() noexcept {
  // The thread that made the controller may be a real-time thread; this one must not delay it.
  const sched_param ordinary{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
  constexpr int kBusyLooks = 50;
  int looks = 0;  // for tasks, since the last one
  std::unique_lock lock(mutex_);
  while (!stop_) {
    if (!tasks.fetch()) {
      looks = std::min(looks + 1, kBusyLooks);
      stopped_.wait_for(lock, std::chrono::microseconds(looks < kBusyLooks ? 200 : 2000));
      continue;
    }
    looks = 0;
    lock.unlock();
    const VibrationTask& task = tasks.value();
    Result& result = results.slot();
    solver.solve(task, result.vibration);
    result.resets = task.resets;
    results.publish();
    lock.lock();
  }
}

}  // namespace dashpot::controller
