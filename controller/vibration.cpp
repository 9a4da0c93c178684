#include <dashpot/controller/vibration.hpp>

#include <algorithm>

namespace dashpot::controller {

VibrationAnalysis::VibrationAnalysis(const Analysis& settings)
    : every_(settings.where == Analysis::Where::kOff ? 0
                                                     : static_cast<std::uint64_t>(settings.every)),
      solver_([&] {
        analysis::SpectrumOptions options;
        options.soft_frequency = settings.soft_frequency;
        options.residual = analysis::SpectrumOptions::Residual::kWorking;
        return options;
      }()) {}

void VibrationAnalysis::reset(Eigen::Index n) noexcept {
  result_.time = 0;
  result_.tick = 0;
  result_.position.setZero(n);
  result_.status = analysis::Status::kOk;
  result_.zero_modes = 0;
  result_.count = 0;
}

void VibrationAnalysis::update(std::int64_t time, std::uint64_t tick,
                               const JointVector& position) noexcept {
  result_.time = time;
  result_.tick = tick;
  result_.position = position;
  result_.status = solver_.solve(system_, spectrum_);
  result_.zero_modes = spectrum_.zero_modes.count;
  result_.count = std::min(spectrum_.modes.size(), kMaxJoints);
  for (int i = 0; i < result_.count; ++i) {
    const analysis::Mode<kMaxJoints>& from = spectrum_.modes[i];
    VibrationMode& to = result_.modes[static_cast<std::size_t>(i)];
    to.eigenvalues = from.eigenvalues;
    to.natural_frequency = from.natural_frequency;
    to.damping_ratio = from.damping_ratio;
    to.damped_frequency = from.damped_frequency;
    to.kind = from.kind;
    to.shape = from.shapes[0];
    to.backward_error = from.backward_error;
    to.error_bound = from.error_bound;
    to.natural_frequency_bound = from.natural_frequency_bound;
    to.damping_ratio_bound = from.damping_ratio_bound;
  }
}

}  // namespace dashpot::controller
