// ControllerCore: from the set-point to the law's torque.
#include <dashpot/controller/core/controller_core.hpp>
#include <dashpot/controller/setpoint_check.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

bool ControllerCore::accept_setpoint(const Setpoint& setpoint) noexcept {
  if (look_ && look_->time == setpoint.time) return look_->in_order;
  const bool same =
      setpoint.mode == accepted_.mode && same_gains(setpoint.gains, accepted_.gains, setpoint.mode);
  const double hold = settings_.watchdog.setpoint_hold;
  const double patience = hold > 0 ? hold : settings_.watchdog.setpoint_damp;
  const bool to_come = patience > 0 && seconds_between(time_, setpoint.time) > patience;
  look_ = {setpoint.time, !to_come && !check_setpoint(setpoint, settings_.limits, same)};
  if (!look_->in_order) return false;
  setpoint_age_ = std::round(1e9 * seconds_between(setpoint.time, time_));
  accepted_.joint_position = setpoint.joint_position;
  accepted_.tip_pose = setpoint.tip_pose;
  accepted_.wrench = setpoint.wrench;
  from_user_ = true;
  const bool in_force = springs_ == Springs::kInForce;
  if (!same) {
    accepted_.mode = setpoint.mode;
    accepted_.gains = setpoint.gains;
    gains_.set_target(Impedance(accepted_, n_));
    if (in_force) start_new_springs();
  }
  if (in_force) update_goal();
  return true;
}

void ControllerCore::start_new_springs() noexcept {
  const Impedance &now = gains_.now(), &then = gains_.target();
  for (int i = 0; i < n_; ++i) {
    if (now.joint_stiffness(i, i) == 0 && then.joint_stiffness(i, i) > 0) {
      references_.joint.relocate(i, q_[i]);
    }
    if (now.null_stiffness[i] == 0 && then.null_stiffness[i] > 0) {
      references_.posture.relocate(i, q_[i]);
    }
  }
  const Eigen::Quaterniond tip(robot_.R_BT);
  Vector6 e;
  e << references_.tip.position() - robot_.p_BT_B,
      short_turn(references_.tip.rotation() * tip.conjugate());
  const Vector6 left =
      without_new_springs(e, now.base, now.tool, then.base, then.tool, robot_.R_BT);
  if (left == e) return;
  references_.tip.relocate(robot_.p_BT_B + left.head<3>(), quaternion(left.tail<3>()) * tip);
}

void ControllerCore::update_goal() noexcept {
  const bool joint = accepted_.mode == Mode::kJoint;
  if (joint && gains_.now().joint_weight == 0) references_.joint.start(q_);
  if (!joint && gains_.now().task_weight == 0) {
    references_.posture.start(q_);
    references_.tip.start(robot_.p_BT_B, Eigen::Quaterniond(robot_.R_BT).normalized());
    law_.reset();
  }
  const JointVector& from = joint ? references_.joint.position() : references_.posture.position();
  if (accepted_.joint_position.size() != n_) {
    goal_ = from;
  } else {
    goal_ = accepted_.joint_position;
    for (int i = 0; i < n_; ++i) {  // a continuous joint goes the short way
      if (turn_[i] > 0) goal_[i] += turn_[i] * std::nearbyint((from[i] - goal_[i]) / turn_[i]);
    }
  }
  goal_rotation_ = Eigen::Quaterniond(accepted_.tip_pose.rotation).normalized();
}

void ControllerCore::attach(const Attachment& attachment) noexcept {
  if (attachment == attachment_.target()) return;
  accepted_.tip_pose = carried(accepted_.tip_pose, attachment_.target().tool, attachment.tool);
  goal_rotation_ = Eigen::Quaterniond(accepted_.tip_pose.rotation).normalized();
  attachment_.set_target(attachment);
}

void ControllerCore::step_attachment() noexcept {
  if (attachment_.still()) return;
  const Pose before = attachment_.now().tool;
  attachment_.step();
  kernel_.attach(attachment_.now());
  const Pose& tool = attachment_.now().tool;
  const TipReference& tip = references_.tip;
  const Pose moved = carried({tip.position(), tip.rotation().toRotationMatrix()}, before, tool);
  references_.tip.relocate(moved.position, Eigen::Quaterniond(moved.rotation).normalized());
}

Pose ControllerCore::tip_goal() const noexcept {
  return carried(accepted_.tip_pose, attachment_.target().tool, attachment_.now().tool);
}

void ControllerCore::limit_tip_speed(const TipSpeed& speed) noexcept {
  constexpr double kReferenceShare = 0.6;  // SafetyFilter takes drive away from 0.65 on
  const Motion& motion = settings_.motion;
  const double limit = std::min(settings_.limits.tip_velocity, speed.limit);
  tip_speed_ = speed;
  if (limit < settings_.limits.tip_velocity) {
    tip_speed_.linear = std::min(speed.linear, kReferenceShare * limit);
  }
  references_.tip.limit_speed(std::min(motion.linear_velocity, tip_speed_.linear),
                              std::min(motion.angular_velocity, tip_speed_.angular));
  filter_.limit_tip_speed(limit);
  motion_watch_.limit_tip_speed(limit);
}

void ControllerCore::restart_springs() noexcept {
  const Impedance target(accepted_, n_);
  Impedance none(n_);
  none.base.selected = target.base.selected;
  none.tool.selected = target.tool.selected;
  none.damping_ratio = target.damping_ratio;  // of springs that grow from zero
  none.joint_damping_ratio = target.joint_damping_ratio;
  none.null_damping_ratio = target.null_damping_ratio;
  gains_.start(none);
  gains_.set_target(target);
  wrench_.start(Vector6::Zero());
  law_.integral().reset();
  if (!from_user_) {
    accepted_.joint_position = q_;
    accepted_.tip_pose =
        carried({robot_.p_BT_B, robot_.R_BT}, attachment_.now().tool, attachment_.target().tool);
  }
  update_goal();
  filter_.begin_anew();
  ++snapshot_.restarts;
  if (snapshot_.restarts > 1) ++restarts_;
}

bool ControllerCore::references_still() const noexcept {
  const Impedance& impedance = gains_.now();  // a reference that is not in force stays as it was
  return (impedance.joint_weight == 0 || references_.joint.velocity().isZero(0)) &&
         (impedance.task_weight == 0 ||
          (references_.posture.velocity().isZero(0) && references_.tip.velocity().isZero(0)));
}

Status ControllerCore::setpoint_age_status() const noexcept {
  const double age = 1e-9 * setpoint_age_;
  const Watchdog& limit = settings_.watchdog;
  if (limit.setpoint_damp > 0 && age > limit.setpoint_damp) return Status::kSetpointLost;
  if (limit.setpoint_hold > 0 && age > limit.setpoint_hold) return Status::kSetpointStale;
  return Status::kOk;
}

double ControllerCore::tip_reference_speed() const noexcept {
  // Of a joint's velocity limit where the robot is; what is left is for vibrations and the null
  // space.
  constexpr double kReferenceShare = 0.4;
  const double speed = references_.tip.speed();
  if (speed == 0) return 1;
  const JointVector qd = law_.null_space().joint_velocity(references_.tip.point_velocity());
  double share = 0;
  for (int i = 0; i < n_; ++i) {
    share = std::max(share, std::abs(qd[i]) / settings_.limits.velocity[i]);
  }
  return share > kReferenceShare * speed ? kReferenceShare * speed / share : 1;
}

double ControllerCore::joint_reference_speed() const noexcept {
  const JointReference& path = references_.joint;
  const bool any = std::isfinite(tip_speed_.linear) || std::isfinite(tip_speed_.angular);
  const double speed = path.speed();
  if (!any || speed == 0) return 1;
  const Vector6 V = twist(robot_.J, path.point_velocity());
  const double share =
      std::max(V.head<3>().norm() / tip_speed_.linear, V.tail<3>().norm() / tip_speed_.angular);
  return share > speed ? speed / share : 1;
}

void ControllerCore::impedance_torque(bool hold, JointVector& tau) noexcept {
  if (springs_ != Springs::kInForce) restart_springs();
  springs_ = Springs::kInForce;
  gains_.step();
  const Vector6 wrench = hold ? Vector6(Vector6::Zero()) : accepted_.wrench;
  if (wrench != wrench_.target()) wrench_.set_target(wrench);
  wrench_.step();

  // Of two modes in force, the one that fades away stays where it is.
  const Impedance& impedance = designed_.update(gains_, robot_);
  const bool joint = accepted_.mode == Mode::kJoint;
  if (impedance.joint_weight > 0) {
    if (joint && !hold) {
      references_.joint.step(goal_, joint_reference_speed());
    } else {
      references_.joint.halt();
    }
  }
  if (impedance.task_weight > 0) {
    if (!joint && !hold) {
      const Eigen::Quaterniond tip(robot_.R_BT);
      const bool there = attachment_.still();
      const Pose goal = there ? accepted_.tip_pose : tip_goal();
      references_.tip.step(
          goal.position, there ? goal_rotation_ : Eigen::Quaterniond(goal.rotation).normalized(),
          {robot_.p_BT_B, tip, robot_.R_BT, impedance.base, impedance.tool, clamp_},
          tip_reference_speed());
      references_.posture.step(goal_);
    } else {
      references_.tip.halt();
      references_.posture.halt();
    }
  }
  law_.torque(robot_, q_, qd_, impedance, references_, wrench_.now(), clamp_, tau);
}

void ControllerCore::integrate(Status limits, bool hold) noexcept {
  using Change = SpringIntegral::Change;
  const std::uint64_t changes = gains_.changes() + attachment_.changes();
  if (changes != integrated_) {
    integrated_ = changes;
    law_.integral().fade(std::max(gains_.steps_left(), attachment_.steps_left()));
    return;
  }
  const Change free = limits == Status::kOk ? Change::kFree : Change::kShrink;
  law_.integrate(hold ? Change::kNone : free);
}

}  // namespace dashpot::controller
