#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/posture_loop.hpp>

#include <cmath>

namespace dashpot::controller {
namespace {

/// Those of a controller whose closed loop has the gains of a set-point from the second tick on,
/// wherever the robot is.
Settings anywhere(Settings settings) {
  constexpr double kFar = 1e5;  // rad: set-points at the robot are within it
  settings.motion.gain_time = settings.period;
  settings.analysis.where = Analysis::Where::kOff;
  settings.analysis.sampled.interval = 0;
  settings.limits.position_lower.setConstant(-kFar);
  settings.limits.position_upper.setConstant(kFar);
  settings.limits.walls.clear();
  return settings;
}

}  // namespace

PostureLoop::PostureLoop(const RobotModel& model, const Settings& settings)
    : kernel_(model), controller_(model, anywhere(settings)) {}

Status PostureLoop::closed_loop(const JointVector& q, const Gains& gains, Mode mode,
                                analysis::System<kMaxJoints>& system,
                                const Vector6& external_wrench) {
  RobotState state;
  state.position = q;
  state.velocity = JointVector::Zero(q.size());
  state.external_wrench = external_wrench;
  DynamicsResult there;
  kernel_.evaluate(q, state.velocity, there);
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.joint_position = q;
  setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  setpoint.gains = gains;
  controller_.reset();
  const auto period = static_cast<std::int64_t>(std::ceil(1e9 * controller_.settings().period));
  JointVector torque;
  for (int tick = 0; tick < 3; ++tick) {
    time_ += period;
    state.time = setpoint.time = time_;
    const Status status = controller_.update(state, setpoint, torque);
    if (status == Status::kSetpointRejected || status > Status::kWeightNotHeld) return status;
  }
  controller_.closed_loop(system);
  return Status::kOk;
}

}  // namespace dashpot::controller
