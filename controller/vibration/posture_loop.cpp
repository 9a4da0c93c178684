#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/vibration/sampled_analysis.hpp>

namespace dashpot::controller {

PostureLoop::PostureLoop(const RobotModel& model, const Settings& settings)
    : kernel_(model),
      elastic_(elastic_joints(model)),
      settings_(settings),
      friction_left_(friction_left(model, settings)),
      damping_(designed_damping(model, settings)) {}

Status PostureLoop::closed_loop(const JointVector& q, const Gains& gains, Mode mode,
                                analysis::System<kMaxJoints>& system,
                                const Vector6& external_wrench) {
  if (q.size() != friction_left_.size()) return Status::kStateWrongSize;
  if (!q.allFinite()) return Status::kStateNotFinite;
  if (!external_wrench.allFinite()) return Status::kWrenchNotFinite;
  const auto n = static_cast<int>(q.size());
  const JointVector rest = JointVector::Zero(n);
  DynamicsResult robot;
  kernel_.evaluate(q, rest, robot);
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.gains = gains;
  const GainBlend given(1, Impedance(setpoint, n));
  damping_.reset();
  const Impedance& impedance = damping_.update(given, robot);
  level_ = damping_.level(given.now());
  controller::closed_loop(robot, rest,
                          {impedance,
                           damping_.null_space(),
                           friction_left_,
                           {external_wrench},
                           Posture{&kernel_, &q, rest, rest}},
                          settings_, system);
  if (elastic_.any()) {
    const JointMatrix load = stiffness_of_load(robot.J, settings_.task_terms.load, external_wrench);
    elastic_.extend(passive_part(robot.J, settings_.environment, load), system);
  }
  return Status::kOk;
}

}  // namespace dashpot::controller
