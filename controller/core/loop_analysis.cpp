#include <dashpot/controller/core/loop_analysis.hpp>

namespace dashpot::controller {

LoopAnalysis::LoopAnalysis(const RobotModel& model, const Settings& settings)
    : n_(model.dof()),
      settings_(settings),
      outside_(!settings.environment.none()),
      elastic_(elastic_joints(model)),
      vibration_(settings, static_cast<int>(elastic_.coordinates())) {
  if (settings.analysis.sampled.interval > 0) {
    sampled_ = std::make_unique<SampledAnalysis>(model, settings);
  }
}

void LoopAnalysis::reset() noexcept {
  vibration_.reset(n_);
  loop_.reset();
  analysed_.reset();
  moved_ = false;
  if (sampled_) sampled_->reset();
}

void LoopAnalysis::update(const Loop& loop) noexcept {
  if (vibration_.due(loop.tick)) find_modes(loop);
  if (sampled_ && sampled_->due(loop.tick)) hand_over(loop);
}

void LoopAnalysis::find_modes(const Loop& loop) noexcept {
  const Sensed& now = loop.now;
  const bool load = settings_.task_terms.load != Load::kIgnored;
  const bool rate = settings_.task_terms.jacobian_rate;
  const bool with_wrench = load && !now.external_wrench.isZero(0);
  const bool with_velocity = rate && !now.qd.isZero(0);
  if (unchanged(loop, with_wrench, with_velocity)) {
    vibration_.repeat(now.time, loop.tick);
    return;
  }
  if (load && !with_wrench) ++vibration_.counters().no_wrench;
  if (rate && !with_velocity) ++vibration_.counters().at_rest;
  VibrationTask& task = vibration_.task();
  task.time = now.time;
  task.tick = loop.tick;
  task.position = now.q;
  task.springs = true;
  if (with_wrench || with_velocity || (outside_ && elastic_.any())) {
    closed_loop(loop, task.system);
  } else {
    std::optional<Impedance> both;
    if (outside_) add_environment(settings_.environment, both.emplace(loop.acting.impedance));
    loop_.form(now.robot, outside_ ? *both : loop.acting.impedance, loop.acting.null_space,
               loop.acting.friction, task.system);
    if (elastic_.any()) elastic_.extend_factored(task.system);
    task.springs = elastic_.any() || task.system.stiffness_factor.rows() > 0;
  }
  vibration_.update();
}

bool LoopAnalysis::unchanged(const Loop& loop, bool with_wrench, bool with_velocity) noexcept {
  const Sensed& now = loop.now;
  const TipWrenches& wrenches = loop.acting.wrenches;
  const std::optional<Posture>& posture = loop.acting.posture;
  const Analysed next{
      loop.springs,
      loop.changes,
      now.q,
      with_velocity ? now.qd : JointVector(JointVector::Zero(n_)),
      with_wrench ? Vector6(wrenches.world + wrenches.commanded) : Vector6(Vector6::Zero()),
      with_wrench && posture ? posture->error : JointVector(JointVector::Zero(n_))};
  const bool moved = analysed_ && analysed_->changes != next.changes;
  const bool settled = moved_ && !moved;
  const bool same = analysed_ == next;
  moved_ = moved;
  analysed_ = next;
  if (settled) vibration_.restart();
  return same && !settled;
}

void LoopAnalysis::closed_loop(const Loop& loop,
                               analysis::System<kMaxJoints>& system) const noexcept {
  controller::closed_loop(loop.now.robot, loop.now.qd, loop.acting, settings_, system);
  if (elastic_.any()) elastic_.extend(passive(loop), system);
}

PassivePart LoopAnalysis::passive(const Loop& loop) const noexcept {
  const Jacobian& J = loop.now.robot.J;
  const Load load = settings_.task_terms.load;
  return passive_part(J, settings_.environment,
                      stiffness_of_load(J, load, loop.now.external_wrench));
}

void LoopAnalysis::hand_over(const Loop& loop) noexcept {
  const Sensed& now = loop.now;
  SampledAnalysis::Task& task = sampled_->task();
  task.time = now.time;
  task.tick = loop.tick;
  task.position = now.q;
  task.attachment = loop.attachment;
  closed_loop(loop, task.system);
  task.passive = passive(loop);
  task.integral = integral_stiffness(now.robot, loop.acting.impedance, settings_.integral.time);
  sampled_->hand_over();
}

}  // namespace dashpot::controller
