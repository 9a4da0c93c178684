#include <dashpot/controller/core/controller_core.hpp>
#include <dashpot/controller/posture_loop.hpp>

namespace dashpot::controller {

PostureLoop::PostureLoop(const RobotModel& model, const Settings& settings)
    : kernel_(model),
      terms_(settings.task_terms),
      environment_(settings.environment),
      friction_left_(friction_left(model, settings)),
      damping_(std::make_unique<DesignedDamping>(designed_damping(model, settings))) {}
PostureLoop::~PostureLoop() = default;
PostureLoop::PostureLoop(PostureLoop&&) noexcept = default;

Status PostureLoop::closed_loop(const JointVector& q, const Gains& gains, Mode mode,
                                analysis::System<kMaxJoints>& system,
                                const Vector6& external_wrench) {
  if (q.size() != friction_left_.size()) return Status::kStateWrongSize;
  if (!q.allFinite()) return Status::kStateNotFinite;
  if (!external_wrench.allFinite()) return Status::kWrenchNotFinite;
  DynamicsResult robot;
  kernel_.evaluate(q, JointVector::Zero(q.size()), robot);
  closed_loop(robot, gains, mode, system, external_wrench);
  return Status::kOk;
}

void PostureLoop::closed_loop(const DynamicsResult& robot, const Gains& gains, Mode mode,
                              analysis::System<kMaxJoints>& system,
                              const Vector6& external_wrench) {
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.gains = gains;
  const auto n = static_cast<int>(friction_left_.size());
  const GainBlend given(1, Impedance(setpoint, n));
  damping_->reset();
  const Impedance& impedance = damping_->update(given, robot);
  controller::closed_loop(robot, JointVector::Zero(n),
                          {impedance, damping_->null_space(), friction_left_, {external_wrench}},
                          terms_, environment_, system);
}

}  // namespace dashpot::controller
