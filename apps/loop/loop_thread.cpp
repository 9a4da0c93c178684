#include <dashpot/apps/loop/loop_thread.hpp>

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <ctime>
#include <limits>

namespace dashpot::apps {

bool lock_memory() noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur != RLIM_INFINITY) {
    if (geteuid() != 0) return false;
  }
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

bool schedule_ahead_of_others() noexcept {
  constexpr int kPriority = 80;  // of SCHED_FIFO
  sched_param parameter{};
  parameter.sched_priority = kPriority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
}

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;  // ns
// Without real time the loop waits for the thread that solves the modes, longer with each tick
// that has to, because a busy machine gives that thread the processor late.
constexpr std::int64_t kPause = 50'000, kLongestPause = kSecond;  // ns

std::int64_t now(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return time.tv_sec * kSecond + time.tv_nsec;
}

void sleep_until(std::int64_t deadline) noexcept {
  const timespec time = {deadline / kSecond, deadline % kSecond};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
  }
}

}  // namespace

LoopThread::LoopThread(ClosedLoop& loop, lcmtypes::Publisher& publisher, CommandSource* commands,
                       const Options& options)
    : loop_(loop),
      publisher_(publisher),
      options_(options),
      journal_(loop.controller(), loop.goal(), publisher, commands, options.pace) {
  journal_.keep_times(options.ticks);
}

LoopThread::~LoopThread() {
  stop();
  if (thread_.joinable()) thread_.join();
}

void LoopThread::start() {
  if (options_.pace == Pace::kRealTime) {
    privileges_.locked = lock_memory();
    loop_.leave_gains();
  }
  thread_ = std::thread([this] { run(); });
}

void LoopThread::join() {
  thread_.join();
  std::vector<std::int32_t>& times = journal_.record.tick_times;
  times.resize(std::min(times.size(), static_cast<std::size_t>(journal_.record.ticks)));
  if (privileges_.locked) munlockall();
}

void LoopThread::run() noexcept {
  const bool real_time = options_.pace == Pace::kRealTime;
  if (real_time) privileges_.scheduled = schedule_ahead_of_others();
  loop_.controller().snapshot();  // the first call allocates, see plugin.h
  const std::int64_t period = std::llround(1e9 * options_.period);
  std::int64_t deadline = now(CLOCK_MONOTONIC) + period;
  std::int64_t pause = 0;
  while (!stop_ && journal_.record.ticks < options_.ticks &&
         journal_.record.simulation == sim::Status::kOk) {
    if (!real_time) {
      tick((journal_.record.ticks * period) / 1000);
      pause = journal_.awaits_modes() ? std::min(std::max(2 * pause, kPause), kLongestPause) : 0;
      if (pause > 0) sleep_until(now(CLOCK_MONOTONIC) + pause);
      continue;
    }
    sleep_until(deadline);
    const std::int64_t late = now(CLOCK_MONOTONIC) - deadline;
    journal_.record.latest_wake_up = std::max(journal_.record.latest_wake_up, late);
    const std::int64_t begin = now(CLOCK_THREAD_CPUTIME_ID);
    tick(now(CLOCK_REALTIME) / 1000);
    const std::int64_t computed = now(CLOCK_THREAD_CPUTIME_ID) - begin;
    deadline += period;
    if (const std::int64_t end = now(CLOCK_MONOTONIC); end > deadline) {
      ++journal_.record.overruns;
      if (computed > period) ++journal_.record.own_overruns;
      if (end > deadline + period) deadline = end;
    }
    overruns_ = journal_.record.overruns;
  }
  if (!real_time) publisher_.publish_pending();
  done_ = true;
}

void LoopThread::tick(std::int64_t utime) noexcept {
  LoopRecord& record = journal_.record;
  journal_.begin_tick();
  loop_.follow_scenario();
  const bool fast = options_.pace == Pace::kFast;
  const std::int64_t computed_before = fast ? now(CLOCK_THREAD_CPUTIME_ID) : 0;
  const std::int64_t begin = now(CLOCK_MONOTONIC);
  const std::int32_t status = loop_.control();
  const std::int64_t time = std::min<std::int64_t>(now(CLOCK_MONOTONIC) - begin,
                                                   std::numeric_limits<std::int32_t>::max());
  // Without real time only the computing time of the tick counts, not the time that other programs
  // take meanwhile.
  if (fast && 1e-9 * static_cast<double>(time) > options_.period &&
      1e-9 * static_cast<double>(now(CLOCK_THREAD_CPUTIME_ID) - computed_before) >
          options_.period) {
    ++record.overruns;
    ++record.own_overruns;
  }
  journal_.note_contact(loop_.contact_force());
  journal_.note_tick(utime, status, static_cast<std::int32_t>(time));
  record.simulation = loop_.move();
  journal_.end_tick();
  ticks_ = record.ticks;
}

}  // namespace dashpot::apps
