#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/core/controller_core.hpp>

namespace dashpot::controller {
Controller::Controller(const RobotModel& model, const Settings& settings)
    : core_((validate(settings, model), std::make_unique<ControllerCore>(model, settings))) {}
Controller::~Controller() = default;
Controller::Controller(Controller&&) noexcept = default;
Controller& Controller::operator=(Controller&&) noexcept = default;

Status Controller::update(const RobotState& state, const Setpoint& setpoint,
                          JointVector& torque) noexcept {
  return core_->update(state, &setpoint, torque);
}
Status Controller::update(const RobotState& state, JointVector& torque) noexcept {
  return core_->update(state, nullptr, torque);
}
const Snapshot& Controller::snapshot() const noexcept {
  return core_->snapshot();
}
const Vibration& Controller::vibration() const noexcept {
  return core_->vibration();
}
const SampledVibration* Controller::sampled_vibration() noexcept {
  SampledAnalysis* sampled = core_->sampled();
  return sampled == nullptr ? nullptr : sampled->latest();
}
void Controller::closed_loop(analysis::System<kMaxJoints>& system) const noexcept {
  core_->closed_loop(system);
}
void Controller::reset() noexcept {
  core_->reset(JointVector());
}
void Controller::reset(const JointVector& torque) noexcept {
  core_->reset(torque);
}
void Controller::release() noexcept {
  if (core_->snapshot().fault != Status::kOk) core_->release();
}
void Controller::stop() noexcept {
  core_->stop();
}
void Controller::attach(const Attachment& attachment) noexcept {
  core_->attach(attachment);
}
void Controller::limit_tip_speed(const TipSpeed& speed) noexcept {
  core_->limit_tip_speed(speed);
}
int Controller::joints() const noexcept {
  return static_cast<int>(core_->settings().limits.torque.size());
}
const Settings& Controller::settings() const noexcept {
  return core_->settings();
}

}  // namespace dashpot::controller
