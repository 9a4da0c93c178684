#include <dashpot/controller/vibration/vibration.hpp>
#include <dashpot/controller/vibration/vibration_thread.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

using analysis::SpectrumOrigin;

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
