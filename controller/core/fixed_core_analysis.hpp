#pragma once
// FixedCore: from the closed loop to its modes.

#include <dashpot/controller/core/fixed_core.hpp>

namespace dashpot::controller {

template <int N>
void FixedCore<N>::analyse() noexcept {
  const TaskTerms& terms = settings_.task_terms;
  const bool with_wrench = terms.geometric_stiffness && !external_wrench_.isZero(0);
  bool with_velocity = false;
  for (int i = 0; i < N && terms.jacobian_rate; ++i) with_velocity |= qd_[i] != 0;
  if (loop_unchanged(with_wrench, with_velocity)) {
    vibration_.repeat(time_, snapshot_.tick);
    return;
  }
  if (terms.geometric_stiffness && !with_wrench) ++vibration_.counters().no_wrench;
  if (terms.jacobian_rate && !with_velocity) ++vibration_.counters().at_rest;
  VibrationTask& task = vibration_.task();
  task.time = time_;
  task.tick = snapshot_.tick;
  task.position = snapshot_.position;
  if (with_wrench || with_velocity) {
    closed_loop(task.system);
    task.springs = true;
  } else {
    loop_.form(robot_, impedance(), law_.null_space(), viscous_friction_, task.system);
    task.springs = task.system.stiffness_factor.rows() > 0;
  }
  vibration_.update();
}

template <int N>
bool FixedCore<N>::loop_unchanged(bool with_wrench, bool with_velocity) noexcept {
  const Vector6 wrench = with_wrench ? external_wrench_ : Vector6(Vector6::Zero());
  const Vector qd = with_velocity ? qd_ : Vector(Vector::Zero());
  bool same = analysed_.any && analysed_.damping_only == damping_only_ &&
              analysed_.gain_changes == gains_.changes() && analysed_.wrench == wrench;
  for (int i = 0; i < N; ++i) same &= analysed_.q[i] == q_[i] && analysed_.qd[i] == qd[i];
  const bool gains_moved = analysed_.any && analysed_.gain_changes != gains_.changes();
  const bool settled = analysed_.gains_moved && !gains_moved;
  analysed_ = {true, damping_only_, gains_moved, gains_.changes(), q_, qd, wrench};
  if (settled) vibration_.restart();
  return same && !settled;
}

template <int N>
void FixedCore<N>::hand_over() noexcept {
  SampledAnalysis::Task& task = sampled_->task();
  task.time = time_;
  task.tick = snapshot_.tick;
  task.position = snapshot_.position;
  closed_loop(task.system);
  sampled_->hand_over();
}

/// Those of the safe output "damp".
template <int N>
Impedance<N> FixedCore<N>::damper() const noexcept {
  Impedance<N> result;
  if (motion_watch_.sees_frozen()) return result;
  for (int i = 0; i < N; ++i) result.joint_damping(i, i) = damping_[i];
  return result;
}

/// Springs and dampers in force, the repulsion of position limits included.
template <int N>
Impedance<N> FixedCore<N>::impedance() const noexcept {
  Impedance<N> all = damping_only_ ? damper() : designed_.now(gains_.now());
  Vector stiffness, damping;
  if (!filter_.repels(q_, !damping_only_, stiffness, damping)) return all;
  for (int i = 0; i < N; ++i) {
    all.joint_stiffness(i, i) += stiffness[i];
    all.joint_damping(i, i) += damping[i];
  }
  all.joint_weight = 1;  // there are joint springs
  return all;
}

template <int N>
void FixedCore<N>::closed_loop(analysis::System<kMaxJoints>& system) const noexcept {
  controller::closed_loop<N>(robot_, qd_, impedance(), law_.null_space(), viscous_friction_,
                             settings_.task_terms, external_wrench_, system);
}

}  // namespace dashpot::controller
