#pragma once
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/snapshot.hpp>

namespace dashpot::controller {

/// Finds the vibration modes of the closed loop. All memory is set aside at set-up.
class VibrationAnalysis {
 public:
  explicit VibrationAnalysis(const Analysis& settings);
  VibrationAnalysis(const VibrationAnalysis&) = delete;
  VibrationAnalysis& operator=(const VibrationAnalysis&) = delete;

  /// Whether this tick (counted from 1) is one to analyse.
  bool due(std::uint64_t tick) const noexcept { return every_ != 0 && (tick - 1) % every_ == 0; }
  /// Where the caller puts the closed loop before `update`.
  analysis::System<kMaxJoints>& system() noexcept { return system_; }
  void update(std::int64_t time, std::uint64_t tick, const JointVector& position) noexcept;
  void reset(Eigen::Index n) noexcept;
  const Vibration& result() const noexcept { return result_; }

 private:
  std::uint64_t every_;  ///< 0: never
  analysis::System<kMaxJoints> system_;
  analysis::SpectrumSolver<kMaxJoints> solver_;
  analysis::Spectrum<kMaxJoints> spectrum_;
  Vibration result_;
};

}  // namespace dashpot::controller
