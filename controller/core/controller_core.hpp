#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>
#include <dashpot/controller/vibration/vibration.hpp>

#include <memory>

namespace dashpot::controller {

/// Implementation of Controller for any number of joints.
class ControllerCore {
 public:
  virtual ~ControllerCore() = default;
  ControllerCore(const ControllerCore&) = delete;
  ControllerCore& operator=(const ControllerCore&) = delete;

  /// `setpoint`: null if there is none; the last one stays then.
  virtual Status update(const RobotState& state, const Setpoint* setpoint,
                        JointVector& torque) noexcept = 0;
  virtual void reset(const JointVector& torque) noexcept = 0;
  virtual void release() noexcept = 0;
  virtual void closed_loop(analysis::System<kMaxJoints>& system) const noexcept = 0;

  const Snapshot& snapshot() const noexcept { return snapshot_; }
  const Vibration& vibration() const noexcept { return vibration_.result(); }
  /// Returns the analysis of the sampled loop; null unless Analysis::Sampled asks for it.
  SampledAnalysis* sampled() noexcept { return sampled_.get(); }
  const Settings& settings() const noexcept { return settings_; }

 protected:
  ControllerCore(const RobotModel& model, const Settings& settings)
      : settings_(settings), vibration_(settings) {
    if (settings.analysis.sampled.interval > 0) {
      sampled_ = std::make_unique<SampledAnalysis>(model, settings);
    }
  }

  Settings settings_;
  Snapshot snapshot_;
  VibrationAnalysis vibration_;
  std::unique_ptr<SampledAnalysis> sampled_;
};

/// Returns the core for the model's number of joints. The settings must be valid.
std::unique_ptr<ControllerCore> make_core(const RobotModel& model, const Settings& settings);

}  // namespace dashpot::controller
