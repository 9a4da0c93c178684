#include <dashpot/controller/core/setpoint_history.hpp>
#include <dashpot/controller/safety/state_check.hpp>
#include <dashpot/controller/setpoint_check.hpp>

namespace dashpot::controller {

static int gain_ticks(const Settings& settings) {
  return static_cast<int>(std::lround(settings.motion.gain_time / settings.period));
}

SetpointHistory::SetpointHistory(const RobotModel& model, const Settings& settings)
    : n_(model.dof()),
      settings_(settings),
      gains_(gain_ticks(settings), Impedance(n_)),
      attachment_(gain_ticks(settings), model.attachment()),
      wrench_(gain_ticks(settings), Vector6::Zero()) {}

void SetpointHistory::reset() noexcept {
  release();
  accepted_ = settings_.initial;
  look_.reset();
  age_ = 0;
  attachment_.start(attachment_.target());
}

void SetpointHistory::release() noexcept {
  accepted_.wrench = settings_.initial.wrench;
  from_user_ = false;
}

Status SetpointHistory::age_status() const noexcept {
  const double age = 1e-9 * age_;
  const Watchdog& limit = settings_.watchdog;
  const bool lost = limit.setpoint_damp > 0 ? age > limit.setpoint_damp : std::isinf(age);
  if (lost) return Status::kSetpointLost;
  if (limit.setpoint_hold > 0 && age > limit.setpoint_hold) return Status::kSetpointStale;
  return Status::kOk;
}

SetpointHistory::News SetpointHistory::take(const Setpoint& setpoint, std::int64_t now) noexcept {
  if (look_ && look_->time == setpoint.time) return look_->in_order ? News::kNone : News::kRefused;
  const bool same =
      setpoint.mode == accepted_.mode && same_gains(setpoint.gains, accepted_.gains, setpoint.mode);
  const double hold = settings_.watchdog.setpoint_hold;
  const double patience = hold > 0 ? hold : settings_.watchdog.setpoint_damp;
  const bool to_come = patience > 0 && seconds_between(now, setpoint.time) > patience;
  look_ = {setpoint.time, !to_come && !check_setpoint(setpoint, settings_.limits, same)};
  if (!look_->in_order) return News::kRefused;
  age_ = nanoseconds(seconds_between(setpoint.time, now));
  accepted_.joint_position = setpoint.joint_position;
  accepted_.tip_pose = setpoint.tip_pose;
  accepted_.wrench = setpoint.wrench;
  from_user_ = true;
  if (same) return News::kGoal;
  accepted_.mode = setpoint.mode;
  accepted_.gains = setpoint.gains;
  gains_.set_target(Impedance(accepted_, n_));
  return News::kGains;
}

void SetpointHistory::restart(const Sensed& now) noexcept {
  const Impedance target(accepted_, n_);
  Impedance none(n_);
  none.base.selected = target.base.selected;
  none.tool.selected = target.tool.selected;
  none.damping_ratio = target.damping_ratio;  // of springs that grow from zero
  none.joint_damping_ratio = target.joint_damping_ratio;
  none.null_damping_ratio = target.null_damping_ratio;
  none.common_ratio = target.common_ratio;
  none.projectors = target.projectors;
  gains_.start(none);
  gains_.set_target(target);
  wrench_.start(Vector6::Zero());
  if (from_user_) return;
  accepted_.joint_position = now.q;
  accepted_.tip_pose = carried({now.robot.p_BT_B, now.robot.R_BT}, attachment_.now().tool,
                               attachment_.target().tool);
}

void SetpointHistory::step(bool hold) noexcept {
  gains_.step();
  const Vector6 wrench = hold ? Vector6(Vector6::Zero()) : accepted_.wrench;
  if (wrench != wrench_.target()) wrench_.set_target(wrench);
  wrench_.step();
}

void SetpointHistory::attach(const Attachment& attachment) noexcept {
  if (attachment == attachment_.target()) return;
  accepted_.tip_pose = carried(accepted_.tip_pose, attachment_.target().tool, attachment.tool);
  attachment_.set_target(attachment);
}

}  // namespace dashpot::controller
