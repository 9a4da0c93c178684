#include <dashpot/apps/loop/loop_samples.hpp>
#include <dashpot/apps/loop/loop_thread.hpp>

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <ctime>
#include <limits>

namespace dashpot::apps {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;  // ns
constexpr std::int64_t kMostTimes = 1 << 24;     // tick times that are kept
constexpr std::int64_t kPublishEvery = 64;       // ticks: all without real time, and samples
constexpr int kPriority = 80;                    // of SCHED_FIFO

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

/// Locks all memory, now and to come, unless the limit on it could stop the program later.
bool lock_memory() noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur != RLIM_INFINITY) {
    if (geteuid() != 0) return false;
  }
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

bool schedule_ahead_of_others() noexcept {
  sched_param parameter{};
  parameter.sched_priority = kPriority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter) == 0;
}

}  // namespace

LoopThread::LoopThread(ClosedLoop& loop, lcmtypes::Publisher& publisher, CommandSource* commands,
                       const Options& options)
    : loop_(loop), publisher_(publisher), commands_(commands), options_(options) {
  record_.tick_times.assign(static_cast<std::size_t>(std::min(options.ticks, kMostTimes)), 0);
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
  const auto recorded = std::min<std::int64_t>(record_.ticks, kMostTimes);
  record_.tick_times.resize(static_cast<std::size_t>(recorded));
  if (privileges_.locked) munlockall();
}

void LoopThread::run() noexcept {
  const bool real_time = options_.pace == Pace::kRealTime;
  if (real_time) privileges_.scheduled = schedule_ahead_of_others();
  loop_.controller().snapshot();  // what a first call allocates, see plugin.h
  const std::int64_t period = std::llround(1e9 * options_.period);
  std::int64_t deadline = now(CLOCK_MONOTONIC) + period;
  while (!stop_ && record_.ticks < options_.ticks && record_.simulation == sim::Status::kOk) {
    if (!real_time) {
      tick((record_.ticks * period) / 1000);
      continue;
    }
    sleep_until(deadline);
    const std::int64_t late = now(CLOCK_MONOTONIC) - deadline;
    record_.latest_wake_up = std::max(record_.latest_wake_up, late);
    const std::int64_t begin = now(CLOCK_THREAD_CPUTIME_ID);
    tick(now(CLOCK_REALTIME) / 1000);
    const std::int64_t computed = now(CLOCK_THREAD_CPUTIME_ID) - begin;
    deadline += period;
    if (const std::int64_t end = now(CLOCK_MONOTONIC); end > deadline) {
      ++record_.overruns;
      if (computed > period) ++record_.own_overruns;
      if (end > deadline + period) deadline = end;
    }
    overruns_ = record_.overruns;
  }
  if (!real_time) publisher_.publish_pending();
  done_ = true;
}

void LoopThread::tick(std::int64_t utime) noexcept {
  released_ = commands_ != nullptr && commands_->take();
  if (commands_ != nullptr) state_.health.commands = commands_->fetch_tally();
  loop_.follow_scenario();
  const bool fast = options_.pace == Pace::kFast;
  const std::int64_t computed_before = fast ? now(CLOCK_THREAD_CPUTIME_ID) : 0;
  const std::int64_t begin = now(CLOCK_MONOTONIC);
  const std::int32_t status = loop_.control();
  const std::int64_t time = std::min<std::int64_t>(now(CLOCK_MONOTONIC) - begin,
                                                   std::numeric_limits<std::int32_t>::max());
  const auto tick_time = static_cast<std::int32_t>(time);

  const bool commanded = commands_ != nullptr && commands_->taken();
  if (commanded && status == DASHPOT_SETPOINT_REJECTED) ++record_.commands_refused;

  const auto kept = static_cast<std::size_t>(record_.ticks % kMostTimes);
  if (kept < record_.tick_times.size()) record_.tick_times[kept] = tick_time;
  const auto last = record_.statuses.size() - 1;
  ++record_.statuses[status < 0 ? last : std::min(static_cast<std::size_t>(status), last)];
  if (record_.ticks > 0 && status != last_status_) ++record_.status_changes;
  last_status_ = status;
  // Without real time nobody waits for the tick: all that matters is that its computing fits, and
  // not what else the machine does meanwhile.
  if (fast && 1e-9 * tick_time > options_.period &&
      1e-9 * static_cast<double>(now(CLOCK_THREAD_CPUTIME_ID) - computed_before) >
          options_.period) {
    ++record_.overruns;
    ++record_.own_overruns;
  }
  publish(utime);
  // Published with the next state.
  state_.health.tick_time = tick_time;
  state_.health.longest_tick_time = std::max(state_.health.longest_tick_time, tick_time);
  state_.health.overruns = record_.overruns;

  record_.simulation = loop_.move();
  ticks_ = ++record_.ticks;
}

void LoopThread::note_fault(const dashpot_snapshot& snapshot) noexcept {
  // One that latches again at the tick that released it has another name.
  if (snapshot.fault != record_.fault || (released_ && snapshot.fault != DASHPOT_OK)) {
    record_.fault = snapshot.fault;
    record_.fault_tick = 0;
    if (record_.fault != DASHPOT_OK) {
      record_.fault_tick = static_cast<std::int64_t>(snapshot.tick);
      ++record_.faults;
    }
  }
  state_.health.fault_tick = record_.fault_tick;
  loop_.note_fault(record_.fault != DASHPOT_OK);
  if (commands_ != nullptr) commands_->set_fault_tick(record_.fault_tick);
}

void LoopThread::publish(std::int64_t utime) noexcept {
  const dashpot_snapshot& snapshot = loop_.controller().snapshot();
  note(snapshot);
  if (record_.ticks == 0) first_restarts_ = snapshot.restarts;
  record_.restarts = snapshot.restarts - first_restarts_;
  note_fault(snapshot);
  state_.utime = utime;
  fill(snapshot, state_.snapshot);
  publisher_.offer(state_);
  bool publish_now = record_.ticks % kPublishEvery == 0;
  const dashpot_modes* modes = loop_.controller().new_modes();
  if (modes != nullptr && modes->time >= 0) {  // not of the hand's guidance
    if (record_.first_modes.tick == 0) record_.first_modes = *modes;
    record_.last_modes = *modes;
    // They may belong to an earlier tick.
    modes_.utime = utime - (snapshot.time - modes->time) / 1000;
    fill(*modes, modes_);
    publisher_.offer(modes_);
    publish_now = true;
  }
  if (options_.pace == Pace::kFast && publish_now) publisher_.publish_pending();
  // Their thread keeps its own pace: with a faster one they would come at no particular time.
  if (options_.pace == Pace::kRealTime && record_.ticks % kPublishEvery == 0) {
    publish_sampled(utime, snapshot.time);
  }
}

void LoopThread::publish_sampled(std::int64_t utime, std::int64_t time) noexcept {
  const dashpot_sampled_modes* modes = loop_.controller().new_sampled_modes();
  if (modes == nullptr || modes->time < 0) return;  // of the hand's guidance
  sampled_.utime = utime - (time - modes->time) / 1000;
  fill(*modes, sampled_);
  publisher_.offer(sampled_);
}

void LoopThread::note(const dashpot_snapshot& snapshot) noexcept {
  if (snapshot.status >= DASHPOT_STATE_NOT_FINITE) return;  // of an earlier tick
  if (snapshot.mode == DASHPOT_MODE_CARTESIAN) {
    record_.cartesian = true;
    const Eigen::Map<const controller::Vector6> error(snapshot.tip_error);
    record_.tip_error = std::max(record_.tip_error, error.head<3>().norm());
    record_.tip_angle_error = std::max(record_.tip_angle_error, error.tail<3>().norm());
    return;
  }
  record_.joint = true;
  for (std::uint32_t i = 0; i < snapshot.joints; ++i) {
    const double error = std::abs(snapshot.reference_joint_position[i] - snapshot.position[i]);
    record_.joint_error = std::max(record_.joint_error, error);
  }
}

}  // namespace dashpot::apps
