// ControllerCore: from the closed loop to its modes.
#include <dashpot/controller/core/controller_core.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>

namespace dashpot::controller {

void ControllerCore::analyse() noexcept {
  const TaskTerms& terms = settings_.task_terms;
  const bool with_wrench = terms.load != Load::kIgnored && !external_wrench_.isZero(0);
  const bool with_velocity = terms.jacobian_rate && !qd_.isZero(0);
  if (loop_unchanged(with_wrench, with_velocity)) {
    vibration_.repeat(time_, snapshot_.tick);
    return;
  }
  if (terms.load != Load::kIgnored && !with_wrench) ++vibration_.counters().no_wrench;
  if (terms.jacobian_rate && !with_velocity) ++vibration_.counters().at_rest;
  VibrationTask& task = vibration_.task();
  task.time = time_;
  task.tick = snapshot_.tick;
  task.position = snapshot_.position;
  if (with_wrench || with_velocity) {
    closed_loop(task.system);
    task.springs = true;
  } else {
    loop_.form(robot_, impedance(), law_.null_space(), joint_friction(), task.system);
    task.springs = task.system.stiffness_factor.rows() > 0;
  }
  vibration_.update();
}

bool ControllerCore::loop_unchanged(bool with_wrench, bool with_velocity) noexcept {
  Analysed now{springs_ != Springs::kOff, false, gains_.changes() + attachment_.changes(), q_, {},
               Vector6::Zero(),           {}};
  if (with_velocity) now.qd = qd_;
  if (with_wrench) {
    now.wrench = external_wrench_ + wrench_.now() + law_.integral().wrench();
    now.posture_error = law_.posture_error();
  }
  bool same = false, settled = false;
  if (analysed_) {
    now.gains_moved = analysed_->gain_changes != now.gain_changes;
    settled = analysed_->gains_moved && !now.gains_moved;
    same = !now.gains_moved && analysed_->springs == now.springs && analysed_->q == now.q &&
           analysed_->qd.size() == now.qd.size() && analysed_->qd == now.qd &&
           analysed_->wrench == now.wrench &&
           analysed_->posture_error.size() == now.posture_error.size() &&
           analysed_->posture_error == now.posture_error;
  }
  analysed_ = now;
  if (settled) vibration_.restart();
  return same && !settled;
}

void ControllerCore::hand_over() noexcept {
  SampledAnalysis::Task& task = sampled_->task();
  task.time = time_;
  task.tick = snapshot_.tick;
  task.position = snapshot_.position;
  task.attachment = attachment_.now();
  closed_loop(task.system);
  JointMatrix load = JointMatrix::Zero(n_, n_);
  if (settings_.task_terms.load != Load::kIgnored) {
    load = stiffness_of_load(robot_.J, settings_.task_terms.load, external_wrench_);
  }
  task.passive = passive_part(robot_.J, settings_.environment, load);
  task.integral = integral_stiffness();
  sampled_->hand_over();
}

JointMatrix ControllerCore::integral_stiffness() const noexcept {
  if (!law_.integral().on()) return {};
  return controller::integral_stiffness(
      robot_, springs_ == Springs::kOff ? Impedance(n_) : gains_.now(), settings_.integral.time);
}

const Impedance& ControllerCore::impedance() noexcept {
  const bool springs = springs_ != Springs::kOff;
  if (springs && !outside_) return designed_.now(gains_.now());
  combined_ = springs ? designed_.now(gains_.now()) : Impedance(n_);
  if (!springs && !motion_watch_.sees_frozen() && fault_ != Status::kBrakeDoubted) {
    combined_.joint_damping = robot_.M / filter_.brake().stopping_time();
  }
  if (outside_) add_environment(settings_.environment, combined_);
  return combined_;
}

void ControllerCore::closed_loop(analysis::System<kMaxJoints>& system) noexcept {
  const TaskTerms& terms = settings_.task_terms;
  JointMatrix load;
  StiffnessTerms more{terms.jacobian_rate};
  const Impedance& given = gains_.now();
  const bool springs = springs_ != Springs::kOff;
  const bool with_wrench = terms.load != Load::kIgnored && !external_wrench_.isZero(0);
  const bool posture = springs && law_.posture_error().size() == n_;
  std::optional<NullSpaceChange> change;
  if (posture && (with_wrench || terms.jacobian_rate)) {
    change.emplace(kernel_, q_, robot_, law_.null_space(), !given.tool.none());
  }
  if (change && terms.jacobian_rate) {
    more.null_space = &*change;
    more.posture_velocity = references_.posture.velocity();
  }
  if (with_wrench) {
    const bool pushes = springs && settings_.feed_forward.wrench;
    TipWrenches wrenches{external_wrench_, pushes ? wrench_.now() : Vector6::Zero().eval()};
    if (springs) wrenches.commanded += law_.integral().wrench();
    std::optional<LoadedPosture> loaded;
    if (change && !given.null_stiffness.isZero(0)) {
      loaded.emplace(LoadedPosture{*change, law_.posture_error()});
    }
    load = stiffness_under_load(robot_, springs ? given : Impedance(n_), terms.load, wrenches,
                                loaded ? &*loaded : nullptr);
    more.load = &load;
  }
  controller::closed_loop(robot_, qd_, impedance(), law_.null_space(), joint_friction(), more,
                          system);
}

}  // namespace dashpot::controller
