#include <dashpot/controller/vibration/vibration_solver.hpp>

namespace dashpot::controller {

namespace {

using analysis::SpectrumOrigin;

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

}  // namespace dashpot::controller
