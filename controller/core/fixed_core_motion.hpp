#pragma once
// FixedCore: from the set-point to the law's torque.

#include <dashpot/controller/core/fixed_core.hpp>

namespace dashpot::controller {

template <int N>
bool FixedCore<N>::accept_setpoint(const Setpoint& setpoint) noexcept {
  if (looked_at_any_ && setpoint.time == looked_at_) return in_order_;
  looked_at_any_ = true;
  looked_at_ = setpoint.time;
  const bool same = setpoint.mode == accepted_.mode && same_gains(setpoint.gains, accepted_.gains);
  const double hold = settings_.watchdog.setpoint_hold;
  const double patience = hold > 0 ? hold : settings_.watchdog.setpoint_damp;
  const bool to_come = patience > 0 && seconds_between(time_, setpoint.time) > patience;
  in_order_ = !to_come && !check_setpoint(setpoint, settings_.limits, same);
  if (!in_order_) return false;
  setpoint_age_ = nanoseconds(seconds_between(setpoint.time, time_));
  accepted_.joint_position = setpoint.joint_position;
  accepted_.tip_pose = setpoint.tip_pose;
  accepted_.wrench = setpoint.wrench;
  from_user_ = true;
  if (!same) {
    accepted_.mode = setpoint.mode;
    accepted_.gains = setpoint.gains;
    gains_.set_target(Impedance<N>::of(accepted_));
    if (!restart_) start_new_springs();
  }
  if (!restart_) update_goal();
  return true;
}

template <int N>
void FixedCore<N>::start_new_springs() noexcept {
  const Impedance<N>&now = gains_.now(), &then = gains_.target();
  for (int i = 0; i < N; ++i) {
    if (now.joint_stiffness(i, i) == 0 && then.joint_stiffness(i, i) > 0) {
      references_.joint.relocate(i, q_[i]);
    }
    if (now.null_stiffness[i] == 0 && then.null_stiffness[i] > 0)
      references_.posture.relocate(i, q_[i]);
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

template <int N>
void FixedCore<N>::update_goal() noexcept {
  const bool joint = accepted_.mode == Mode::kJoint;
  if (joint && gains_.now().joint_weight == 0) references_.joint.start(q_);
  if (!joint && gains_.now().task_weight == 0) {
    references_.posture.start(q_);
    references_.tip.start(robot_.p_BT_B, Eigen::Quaterniond(robot_.R_BT).normalized());
    law_.reset();
  }
  const Vector& from = joint ? references_.joint.position() : references_.posture.position();
  goal_ = from;
  if (accepted_.joint_position.size() == N) {
    goal_ = fixed<N>(accepted_.joint_position);
    for (int i = 0; i < N; ++i) {  // a continuous joint goes the short way
      if (turn_[i] > 0) goal_[i] += turn_[i] * std::nearbyint((from[i] - goal_[i]) / turn_[i]);
    }
  }
  goal_rotation_ = Eigen::Quaterniond(accepted_.tip_pose.rotation).normalized();
}

template <int N>
void FixedCore<N>::restart_springs() noexcept {
  const Impedance<N> target = Impedance<N>::of(accepted_);
  Impedance<N> none;
  none.base.selected = target.base.selected;
  none.tool.selected = target.tool.selected;
  none.damping_ratio = target.damping_ratio;  // of springs that grow from zero
  none.joint_damping_ratio = target.joint_damping_ratio;
  gains_.start(none);
  gains_.set_target(target);
  wrench_.start(Vector6::Zero());
  if (!from_user_) {
    copy<N>(q_, accepted_.joint_position);
    accepted_.tip_pose = {robot_.p_BT_B, robot_.R_BT};
  }
  update_goal();
  filter_.begin_anew();
  restart_ = false;
  ++snapshot_.restarts;
  if (snapshot_.restarts > 1) ++restarts_;
}

template <int N>
bool FixedCore<N>::references_still() const noexcept {
  const auto at_rest = [](const auto& velocity) {
    bool rest = true;
    for (Eigen::Index i = 0; i < velocity.size(); ++i) rest &= velocity[i] == 0;
    return rest;
  };
  return at_rest(references_.joint.velocity()) && at_rest(references_.posture.velocity()) &&
         at_rest(references_.tip.velocity());
}

template <int N>
Status FixedCore<N>::setpoint_age_status() const noexcept {
  const double age = 1e-9 * setpoint_age_;
  const Watchdog& limit = settings_.watchdog;
  if (limit.setpoint_damp > 0 && age > limit.setpoint_damp) return Status::kSetpointLost;
  if (limit.setpoint_hold > 0 && age > limit.setpoint_hold) return Status::kSetpointStale;
  return Status::kOk;
}

/// Returns the share of its speed limits at which the tip's reference takes no joint beyond
/// kReferenceShare of the joint's velocity limit where the robot is.
template <int N>
double FixedCore<N>::tip_reference_speed() const noexcept {
  constexpr double kReferenceShare = 0.4;  // what is left is for vibrations and the null space
  const double speed = references_.tip.speed();
  if (speed == 0) return 1;
  const Vector qd = law_.null_space().joint_velocity(references_.tip.point_velocity());
  double share = 0;
  for (int i = 0; i < N; ++i) {
    share = std::max(share, std::abs(qd[i]) / settings_.limits.velocity[i]);
  }
  return share > kReferenceShare * speed ? kReferenceShare * speed / share : 1;
}

template <int N>
Joints<N> FixedCore<N>::impedance_torque(bool hold) noexcept {
  if (restart_) restart_springs();
  damping_only_ = false;
  gains_.step();
  const Vector6 wrench = hold ? Vector6(Vector6::Zero()) : accepted_.wrench;
  if (wrench != wrench_.target()) wrench_.set_target(wrench);
  wrench_.step();

  // Of two modes in force, the one that fades away stays where it is.
  const Impedance<N>& impedance = designed_.update(gains_, robot_);
  const bool joint = accepted_.mode == Mode::kJoint;
  if (impedance.joint_weight > 0) {
    if (joint && !hold) {
      references_.joint.step(goal_);
    } else {
      references_.joint.halt();
    }
  }
  if (impedance.task_weight > 0) {
    if (!joint && !hold) {
      const Eigen::Quaterniond tip(robot_.R_BT);
      references_.tip.step(
          accepted_.tip_pose.position, goal_rotation_,
          {robot_.p_BT_B, tip, robot_.R_BT, impedance.base, impedance.tool, clamp_},
          tip_reference_speed());
      references_.posture.step(goal_);
    } else {
      references_.tip.halt();
      references_.posture.halt();
    }
  }
  return law_.torque(robot_, q_, qd_, impedance, references_, wrench_.now(), clamp_);
}

}  // namespace dashpot::controller
