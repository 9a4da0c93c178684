#pragma once
#include <dashpot/controller/core/sensed.hpp>
#include <dashpot/controller/vibration/loop_system.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>
#include <dashpot/controller/vibration/vibration.hpp>

#include <memory>
#include <optional>

namespace dashpot::controller {

/// Finds the modes of the closed loop, tick by tick, and passes the loop to the analysis of the
/// sampled loop at intervals.
class LoopAnalysis {
 public:
  LoopAnalysis(const RobotModel& model, const Settings& settings);
  void reset() noexcept;

  /// The loop that a tick closed.
  struct Loop {
    std::uint64_t tick;
    const Sensed& now;
    double springs;  ///< share of their stiffness that acts; 0: the brake or nothing does
    Acting acting;
    std::uint64_t changes;  ///< of gains and attachment so far
    const Attachment& attachment;
  };
  /// Returns true if it is time to analyse the loop of this tick.
  bool due(std::uint64_t tick) const noexcept {
    return vibration_.due(tick) || (sampled_ && sampled_->due(tick));
  }
  void update(const Loop& loop) noexcept;
  void collect() noexcept { vibration_.collect(); }
  /// Sets `system` to a loop, with the terms and the environment of the settings.
  void closed_loop(const Loop& loop, analysis::System<kMaxJoints>& system) const noexcept;

  const Vibration& result() const noexcept { return vibration_.result(); }
  /// Returns the analysis of the sampled loop; null unless Analysis::Sampled asks for it.
  SampledAnalysis* sampled() noexcept { return sampled_.get(); }

 private:
  /// Input of the last analysis. qd, wrench and posture_error are zero if they do not matter.
  struct Analysed {
    double springs;
    std::uint64_t changes;
    JointVector q, qd;
    Vector6 wrench;
    JointVector posture_error;
    bool operator==(const Analysed&) const = default;
  };

  void find_modes(const Loop& loop) noexcept;
  /// Returns true if the loop is exactly the loop of the last analysis.
  bool unchanged(const Loop& loop, bool with_wrench, bool with_velocity) noexcept;
  void hand_over(const Loop& loop) noexcept;
  PassivePart passive(const Loop& loop) const noexcept;

  const int n_;
  const Settings settings_;
  const bool outside_;  ///< whether there is an environment
  const analysis::Gears elastic_;
  VibrationAnalysis vibration_;
  LoopSystem loop_;
  std::unique_ptr<SampledAnalysis> sampled_;
  std::optional<Analysed> analysed_;
  bool moved_ = false;  ///< gains or attachment had changed before the last analysis
};

}  // namespace dashpot::controller
