#include <dashpot/controller/latest.hpp>
#include <dashpot/controller/vibration/vibration.hpp>

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace dashpot::controller {

using analysis::SpectrumOrigin;

/// A thread that solves the latest task. The real-time thread hands tasks over and fetches results
/// without waiting, locking or calling the system. It does not wake this thread, which looks for
/// tasks every 200 us, or every 2 ms if there was none for some time.
class VibrationThread {
 public:
  struct Result {
    Vibration vibration;
    std::uint64_t resets = 0;
  };

  explicit VibrationThread(const Analysis& settings)
      : solver(settings), thread_([this] { run(); }) {}

  ~VibrationThread() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    stopped_.notify_one();
    thread_.join();
  }
  VibrationThread(const VibrationThread&) = delete;
  VibrationThread& operator=(const VibrationThread&) = delete;

  Latest<VibrationTask> tasks;  ///< from the real-time thread
  Latest<Result> results;       ///< to the real-time thread
  /// Belongs to this thread from the publication of a task to the publication of its result. While
  /// there is no task, the real-time thread may use it.
  VibrationSolver solver;

 private:
  void run() noexcept {
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

  std::mutex mutex_;  ///< guards stop_; the real-time thread does not use it
  std::condition_variable stopped_;
  bool stop_ = false;
  std::thread thread_;  ///< the last member: it uses the others
};

namespace {

analysis::TrackerOptions tracker_options(const Analysis& settings) {
  analysis::TrackerOptions options;
  options.soft_frequency = settings.soft_frequency;
  options.shapes = settings.shapes;
  return options;
}

std::size_t at(int i) {
  return static_cast<std::size_t>(i);
}

}  // namespace

VibrationSolver::VibrationSolver(const Analysis& settings)
    : shapes_(settings.shapes), tracker_(tracker_options(settings)) {}

void VibrationSolver::reset() noexcept {
  tracker_.forget();
  counters_ = {};
  solved_ = restarted_ = 0;
}

bool VibrationSolver::solve(const VibrationTask& task, Vibration& result,
                            analysis::Work& work) noexcept {
  if (task.resets != resets_) reset();
  resets_ = task.resets;
  if (task.springs) {
    if (task.restarts != restarted_) tracker_.reset();
    restarted_ = task.restarts;
    if (tracker_.update(task.system, spectrum_, work) == analysis::Status::kUnfinished)
      return false;
  }
  result.time = task.time;
  result.tick = task.tick;
  result.position = task.position;
  counters_.missed += task.number - solved_ - 1;
  solved_ = task.number;
  if (task.springs) {
    publish_modes(result);
    const bool found =
        result.status == analysis::Status::kOk || result.status == analysis::Status::kUncertified;
    if (!found) {
      result.zero_modes = 0;
      ++counters_.failed;
    } else {
      ++(result.origin == SpectrumOrigin::kTracked  ? counters_.tracked
         : result.origin == SpectrumOrigin::kReused ? counters_.reused
                                                    : counters_.direct);
      if (result.zero_modes == 0) ++counters_.no_zero_modes;
      if (!shapes_) ++counters_.no_shapes;
    }
  } else {
    result.status = analysis::Status::kOk;
    result.origin = SpectrumOrigin::kDirect;
    result.zero_modes = static_cast<int>(task.position.size());
    result.count = 0;
    ++counters_.no_springs;
  }
  result.counters = counters_;
  result.counters.unchanged = task.counters.unchanged;
  result.counters.no_wrench = task.counters.no_wrench;
  result.counters.at_rest = task.counters.at_rest;
  return true;
}

void VibrationSolver::publish_modes(Vibration& result) const noexcept {
  result.status = spectrum_.status;
  result.origin = spectrum_.origin;
  result.zero_modes = spectrum_.zero_mode_count;
  result.count = spectrum_.mode_count;
  for (int i = 0; i < result.count; ++i) {
    const int index = spectrum_.order[at(i)];
    const analysis::ModeNumbers& from = spectrum_.modes[at(index)];
    VibrationMode& to = result.modes[at(i)];
    to.label = spectrum_.label(index);
    to.kind = from.kind;
    to.eigenvalues = from.eigenvalues;
    to.natural_frequency = from.natural_frequency;
    to.damping_ratio = from.damping_ratio;
    to.damped_frequency = from.damped_frequency;
    to.error_bound = from.error_bound;
    to.natural_frequency_bound = from.natural_frequency_bound;
    to.damping_ratio_bound = from.damping_ratio_bound;
    if (shapes_) to.shape = spectrum_.shapes[at(index)].u[0];
  }
}

namespace {

std::int64_t analysis_budget(const Settings& settings, int coordinates) {
  const double share = settings.analysis.share;
  const double size = static_cast<double>(coordinates) / 7;
  const double even = 10 * share * Analysis::kEvenWork * std::max(1.0, size * size * size);
  return static_cast<std::int64_t>(
      std::min(share * settings.period * Analysis::kWorkPerSecond, even));
}

/// Most tasks that wait after a failed task before one is tried within the tick again.
constexpr int kLongestWait = 64;

}  // namespace

VibrationAnalysis::VibrationAnalysis(const Settings& settings, int coordinates)
    : every_(settings.analysis.where == Analysis::Where::kOff
                 ? 0
                 : static_cast<std::uint64_t>(settings.analysis.every)),
      background_(settings.analysis.where == Analysis::Where::kBackground),
      budget_(analysis_budget(settings, coordinates)) {
  if (every_ != 0) thread_ = std::make_unique<VibrationThread>(settings.analysis);
}

VibrationAnalysis::~VibrationAnalysis() = default;

VibrationTask& VibrationAnalysis::task() noexcept {
  return thread_->tasks.slot();
}

void VibrationAnalysis::update() noexcept {
  VibrationTask& given = task();
  given.number = ++tasks_;
  given.restarts = restarts_;
  given.resets = resets_;
  given.counters = counters_;
  if (background_) {
    thread_->tasks.publish();
    return;
  }
  result_.work = 0;
  missed_ = away_;
  if (!away_) try_within_tick(given);
  if (!away_) return;
  if (!from_thread_) announce(given);
  if (!missed_) thread_->tasks.publish();
}

/// Solves the task, or leaves it to the thread.
void VibrationAnalysis::try_within_tick(const VibrationTask& given) noexcept {
  away_ = true;
  if (!worth_trying(given)) return;
  analysis::Work work(budget_);
  away_ = !thread_->solver.solve(given, result_, work);
  result_.work = work.done();
  if (away_) {
    wait_ = next_wait_ = std::min(2 * next_wait_ + 1, kLongestWait);
  } else {
    wait_ = next_wait_ = 0;
    from_thread_ = false;
  }
}

bool VibrationAnalysis::worth_trying(const VibrationTask& given) noexcept {
  const bool again = given.restarts != tried_restarts_;
  if (!again && given.springs && !thread_->solver.follows() && wait_ > 0) {
    --wait_;
    return false;
  }
  tried_restarts_ = given.restarts;
  from_thread_ = from_thread_ && !again;
  return true;
}

/// Reports that there are no modes yet.
void VibrationAnalysis::announce(const VibrationTask& given) noexcept {
  result_.time = given.time;
  result_.tick = given.tick;
  result_.position = given.position;
  result_.status = analysis::Status::kUnfinished;
  result_.origin = SpectrumOrigin::kDirect;
  result_.zero_modes = result_.count = 0;
}

void VibrationAnalysis::repeat(std::int64_t time, std::uint64_t tick) noexcept {
  if (missed_) {  // the task is still there
    task().time = time;
    task().tick = tick;
    update();
    return;
  }
  ++counters_.unchanged;
  if (background_) return;
  result_.time = time;
  result_.tick = tick;
  if (result_.count > 0) result_.origin = SpectrumOrigin::kReused;
  result_.counters.unchanged = counters_.unchanged;
  result_.work = 0;
}

void VibrationAnalysis::collect() noexcept {
  if (!(background_ || away_) || !thread_->results.fetch()) return;
  const VibrationThread::Result& latest = thread_->results.value();
  away_ = false;
  if (latest.resets != resets_) return;
  if (background_) {
    shown_ = &latest.vibration;
    return;
  }
  result_ = latest.vibration;
  result_.counters.unchanged = counters_.unchanged;
  result_.work = 0;
  from_thread_ = true;
}

void VibrationAnalysis::reset(Eigen::Index n) noexcept {
  ++resets_;
  tasks_ = restarts_ = 0;
  counters_ = {};
  missed_ = from_thread_ = false;
  tried_restarts_ = 0;
  wait_ = next_wait_ = 0;
  result_.time = 0;
  result_.tick = 0;
  result_.position.setZero(n);
  result_.status = analysis::Status::kOk;
  result_.origin = SpectrumOrigin::kDirect;
  result_.zero_modes = 0;
  result_.count = 0;
  result_.counters = {};
  result_.work = 0;
  shown_ = &result_;
}

}  // namespace dashpot::controller
