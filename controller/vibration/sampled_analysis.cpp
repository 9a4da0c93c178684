#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

#include <pthread.h>
#include <sched.h>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>

namespace dashpot::controller {
namespace {

constexpr std::chrono::milliseconds kLook{5};  // how often the thread looks for a task

}  // namespace

SampledAnalysis::SampledAnalysis(const RobotModel& model, const Settings& settings)
    : arm_(model, timing_of(settings)),
      interval_(static_cast<std::uint64_t>(
          std::clamp(std::round(settings.analysis.sampled.interval / settings.period), 1.0, 1e15))),
      first_(1 + static_cast<std::uint64_t>(std::clamp(
                     std::ceil(settings.motion.gain_time / settings.period), 1.0, 1e15))),
      next_(first_),
      thread_([this] { run(); }) {}

SampledAnalysis::~SampledAnalysis() {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
}

void SampledAnalysis::hand_over() noexcept {
  next_ = task().tick + interval_;
  task().resets = resets_.load(std::memory_order_relaxed);
  tasks_.publish();
}

void SampledAnalysis::reset() noexcept {
  next_ = first_;
  resets_.fetch_add(1, std::memory_order_relaxed);
}

const SampledVibration* SampledAnalysis::latest() noexcept {
  results_.fetch();
  const SampledVibration& found = results_.value();
  return found.resets == resets_.load(std::memory_order_relaxed) ? &found : nullptr;
}

void SampledAnalysis::run() noexcept {
  // The thread that made the controller may be a real-time thread; this one must not delay it.
  const sched_param ordinary{};
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
  while (!stop_.load(std::memory_order_relaxed)) {
    if (!tasks_.fetch()) {
      std::this_thread::sleep_for(kLook);
      continue;
    }
    SampledVibration& result = results_.slot();
    try {
      solve(tasks_.value(), result);
    } catch (const std::exception&) {
      result.count = 0;
      if (result.status == analysis::Status::kOk ||
          result.status == analysis::Status::kUncertified) {
        result.status = analysis::Status::kNotConverged;
      }
      result.spectral_radius = result.gain_margin = std::numeric_limits<double>::quiet_NaN();
    }
    results_.publish();
  }
}

void SampledAnalysis::solve(const Task& task, SampledVibration& result) {
  result = SampledVibration();
  result.time = task.time;
  result.tick = task.tick;
  result.resets = task.resets;
  result.position = task.position;
  result.assumes = arm_.assumes();
  const analysis::System<> system = unbounded(task.system);
  const analysis::Spectrum<> continuous = analysis::analyze(system);
  result.status = continuous.status;
  arm_.attach(task.attachment);
  const analysis::SampledLoop loop =
      with_gears(arm_.at(task.position, &task.passive, task.integral));
  const analysis::SampledSpectrum sampled = analysis::sample_loop(system, continuous, loop);
  result.spectral_radius = sampled.spectral_radius;
  result.gain_margin = analysis::gain_margin(system, continuous, loop);
  const std::size_t slow = std::min(sampled.memory.size(), result.integrals.size());
  for (std::size_t i = 0; i < slow; ++i) {
    result.integrals[i] = std::log(sampled.memory[i]) / loop.period;
  }
  result.integral_count = static_cast<int>(slow);
  result.count = static_cast<int>(sampled.modes.size());
  for (std::size_t i = 0; i < sampled.modes.size(); ++i) {
    const analysis::SampledMode& from = sampled.modes[i];
    const auto& origin = continuous.modes[static_cast<int>(i)];
    result.modes[i] = {
        from.kind,          origin.natural_frequency, origin.damping_ratio, from.natural_frequency,
        from.damping_ratio, from.damped_frequency};
  }
}

}  // namespace dashpot::controller
