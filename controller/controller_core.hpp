#pragma once
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/controller/vibration.hpp>

#include <memory>

namespace dashpot::controller {

/// What Controller does, for any number of joints.
class ControllerCore {
 public:
  virtual ~ControllerCore() = default;
  ControllerCore(const ControllerCore&) = delete;
  ControllerCore& operator=(const ControllerCore&) = delete;

  virtual Status update(const RobotState& state, const Setpoint& setpoint,
                        JointVector& torque) noexcept = 0;
  virtual void reset(const JointVector& torque) noexcept = 0;
  virtual void closed_loop(analysis::System<kMaxJoints>& system) const noexcept = 0;

  const Snapshot& snapshot() const noexcept { return snapshot_; }
  const Vibration& vibration() const noexcept { return vibration_.result(); }
  const Settings& settings() const noexcept { return settings_; }

 protected:
  explicit ControllerCore(const Settings& settings)
      : settings_(settings), vibration_(settings.analysis) {}

  Settings settings_;
  Snapshot snapshot_;
  VibrationAnalysis vibration_;
};

/// The core for the model's number of joints. The settings are valid.
std::unique_ptr<ControllerCore> make_core(const RobotModel& model, const Settings& settings);

}  // namespace dashpot::controller
