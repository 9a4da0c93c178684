#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/core/controller_core.hpp>
#include <dashpot/controller/core/gears_stop.hpp>
#include <dashpot/controller/core/thresholds.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

ControllerCore::ControllerCore(const RobotModel& model, const Settings& settings)
    : n_(model.dof()),
      settings_(settings),
      state_check_(model, settings),
      kernel_(model),
      setpoints_(model, settings),
      faults_(model, settings),
      designed_(designed_damping(model, settings)),
      generator_(model, settings),
      law_(model, settings.feed_forward),
      integral_(settings.integral, settings.period),
      tank_(model, settings),
      filter_(settings, gears_stopping_time(model, settings, Brake(settings).stopping_time())),
      analysis_(model, settings),
      viscous_friction_(model.joint_values(&Joint::viscous_friction)),
      friction_left_(friction_left(model, settings)),
      brake_(n_) {
  sensed_.q = sensed_.qd = sensed_.weight = JointVector::Zero(n_);
  reset(JointVector());
}

void ControllerCore::reset(const JointVector& torque) noexcept {
  state_check_.reset();
  faults_.reset();
  given_ = torque.size() == n_ && torque.allFinite();
  if (given_) {
    filter_.reset(torque);
  } else {
    filter_.restart();
  }
  forget_springs();
  setpoints_.reset();
  kernel_.attach(setpoints_.attachment().now());
  sensed_.any = false;
  sensed_.external_wrench.setZero();
  designed_.reset();
  tank_.reset();
  analysis_.reset();
  snapshot_ = Snapshot();
  for (JointVector* vector :
       {&snapshot_.position, &snapshot_.velocity, &snapshot_.torque, &snapshot_.law_torque,
        &snapshot_.reference_position, &snapshot_.reference_velocity, &snapshot_.joint_error,
        &snapshot_.integral_torque}) {
    vector->setZero(n_);
  }
}

void ControllerCore::release() noexcept {
  faults_.release();
  tank_.fill();
  forget_springs();
}

void ControllerCore::forget_springs() noexcept {
  state_check_.trust_velocities();
  setpoints_.release();
  integral_.reset();
  filter_.brake().firm();
  filter_.begin_anew();  // what was held fades evenly
  aim_ = Aim::kStop;
}

void ControllerCore::limit_tip_speed(const TipSpeed& speed) noexcept {
  const double limit = std::min(settings_.limits.tip_velocity, speed.limit);
  TipSpeed of_references = speed;
  if (limit < settings_.limits.tip_velocity) {
    of_references.linear = std::min(speed.linear, kShareOfTipLimit * limit);
  }
  generator_.limit_tip_speed(of_references);
  filter_.limit_tip_speed(limit);
  faults_.limit_tip_speed(limit);
}

Status ControllerCore::update(const RobotState& state, const Setpoint* setpoint,
                              JointVector& torque) noexcept {
  ++snapshot_.tick;
  snapshot_.time = state.time;

  // Check the state.
  const Status input = state_check_.check(state);
  const double age = state_check_.age(), longest_gap = settings_.watchdog.longest_gap;
  if (input >= Status::kStateNotFinite) {
    if (state.position.size() == n_ && state.position.allFinite()) {
      snapshot_.position = state.position;  // the rest stays as in the last good state
    }
    if (state.velocity.size() == n_ && state.velocity.allFinite()) {
      snapshot_.velocity = state.velocity;
    }
    const double lost = sensed_.any ? age : 0;
    go_blind(std::max(lost, faults_.blind() + settings_.period), torque);
    faults_.applied(input, sensed_, lost, torque);
    return finish(input, torque);
  }
  sensed_.dt = sensed_.any ? std::max(settings_.period, age) : settings_.period;
  if (sensed_.any) setpoints_.age(sensed_.dt);
  if (sensed_.dt > longest_gap) filter_.brake().forget();
  sensed_.any = true;
  sensed_.time = state.time;
  sensed_.q = state_check_.position();
  sensed_.qd = state_check_.velocity();
  const bool wrench_known = state.external_wrench.allFinite();
  if (wrench_known) sensed_.external_wrench = state.external_wrench;

  // Evaluate the robot there, with what it carries now.
  const bool same_body = setpoints_.attachment().still();
  if (!same_body) {
    const Pose before = setpoints_.attachment().now().tool;
    setpoints_.step_attachment();
    kernel_.attach(setpoints_.attachment().now());
    generator_.carry(before, setpoints_.attachment().now().tool);
  }
  kernel_.evaluate(sensed_.q, sensed_.qd, sensed_.robot);
  if (settings_.feed_forward.gravity) sensed_.weight = sensed_.robot.gravity;
  filter_.assume(sensed_.weight);
  if (tank_.on()) {
    tank_.count_work(sensed_.q, sensed_.robot.M, sensed_.weight, sensed_.dt, same_body);
  }

  // Take over the set-point.
  Status status = wrench_known ? Status::kOk : Status::kWrenchNotFinite;
  if (setpoint != nullptr) {
    const SetpointHistory::News news = setpoints_.take(*setpoint, sensed_.time);
    if (news == SetpointHistory::News::kRefused) status = Status::kSetpointRejected;
    if (in_force() && news >= SetpointHistory::News::kGoal) {
      generator_.set_goal(setpoints_, news == SetpointHistory::News::kGains, sensed_);
    }
  }
  status = worse(status, setpoints_.age_status());

  // Watch the motion.
  const bool odd_stamp = input == Status::kTimeBackward && state_check_.backward() <= longest_gap;
  Status seen = odd_stamp ? Status::kOk : input;  // a stamp or two that say nothing
  // Without the wrench, Limits::external_force protects no one.
  const bool blind = !wrench_known && std::isfinite(settings_.limits.external_force);
  if (blind) seen = worse(seen, Status::kCollision);
  const bool brakes = aim_ != Aim::kSprings;
  const bool still = generator_.still(setpoints_.gains().now());
  const bool latched = faults_.fault() != Status::kOk;
  status = worse(status, faults_.watch(seen, sensed_, still, brakes ? &filter_.brake() : nullptr));
  if (latched && faults_.fault() == Status::kOk) forget_springs();

  // Ask the law, or leave it to the brake.
  const bool hold = status == Status::kSetpointStale;
  const SmallCholesky* factor = nullptr;  // of M, if it is known
  if (status < Status::kSetpointLost) {
    if (aim_ != Aim::kSprings) restart_springs();
    setpoints_.step(hold);
    const Impedance &given = setpoints_.gains().now(),
                    &impedance = designed_.update(setpoints_.gains(), sensed_.robot);
    const NullSpace& null_space = designed_.null_space();
    generator_.step(setpoints_, hold, sensed_, null_space);
    const ImpedanceLaw::Input law{
        sensed_.robot,      sensed_.q,           sensed_.qd,
        impedance,          null_space,          generator_.references(),
        generator_.clamp(), setpoints_.wrench(), integral_.on() ? &integral_ : nullptr};
    law_.torque(law, asked_);
    short_ = tank_.on() && tank_.limit(law, sensed_.weight, asked_);
    if (short_) status = worse(status, Status::kTorqueLimited);
    torque = asked_.torque;
    level_ = designed_.level(given);
    // While gains change, dampers that fade keep the margin as well.
    if (!level_.kept && setpoints_.gains().still()) status = worse(status, Status::kLittleMargin);
    if (given.task_weight > 0) factor = &null_space.mass();
  } else {
    if (faults_.blind() > 0) filter_.begin_anew();
    brake();
    torque = sensed_.weight;
  }

  // Limit the torque.
  const Status limits =
      filter_.apply({sensed_.q, sensed_.qd, sensed_.robot, sensed_.weight, factor},
                    faults_.tip_speed(), aim_, asked_.dampers, torque);
  if (in_force() && integral_.on()) {
    const bool may_grow = limits == Status::kOk && !asked_.clamped && !short_;
    if (setpoints_.changes() != integrated_) {
      integral_.fade(setpoints_.steps_left());
    } else if (!hold) {
      integral_.step(asked_.joint_pull, asked_.tip_pull, may_grow);
    }
    integrated_ = setpoints_.changes();
  }
  status = worse(status, limits);
  faults_.applied(status, sensed_, 0, torque);

  show();
  return finish(odd_stamp ? worse(status, input) : status, torque);
}

void ControllerCore::go_blind(double lost, JointVector& torque) noexcept {
  if (lost > kWeightHeld || !(sensed_.any || given_)) return filter_.ramp(torque);
  if (lost <= settings_.watchdog.longest_gap || !sensed_.any) return filter_.repeat(torque);
  brake();
  torque = sensed_.weight;
  const bool floats = aim_ == Aim::kFloat;  // the velocity or the brake was doubted before
  filter_.apply({sensed_.q, sensed_.qd, sensed_.robot, sensed_.weight, nullptr}, 0,
                floats ? Aim::kFloat : Aim::kBlind, asked_.dampers, torque);
  if (!floats) add(filter_.brake().slowing(), sensed_.qd, settings_.period);
}

void ControllerCore::restart_springs() noexcept {
  aim_ = Aim::kSprings;
  setpoints_.restart(sensed_);
  generator_.set_goal(setpoints_, false, sensed_);
  integral_.reset();
  law_.reset();
  filter_.begin_anew();
  if (snapshot_.restarts++ > 0) faults_.count_restart();
}

void ControllerCore::brake() noexcept {
  if (aim_ == Aim::kSprings) filter_.begin_anew();
  aim_ = faults_.aim();
  integral_.reset();
  tank_.no_springs();
  level_ = {};
  asked_.tip_error.setZero();
  asked_.tip_wrench.setZero();
  brake_.joint_damping = sensed_.robot.M / filter_.brake().stopping_time();
  if (aim_ == Aim::kFloat) brake_.joint_damping.setZero();
}

LoopAnalysis::Loop ControllerCore::loop() const noexcept {
  const bool springs = aim_ == Aim::kSprings;
  TipWrenches wrenches{sensed_.external_wrench};
  if (springs && settings_.feed_forward.wrench) wrenches.commanded = setpoints_.wrench();
  if (springs) wrenches.commanded += integral_.wrench();
  std::optional<Posture> posture;
  if (springs && asked_.posture_error.size() == n_) {
    posture = {&kernel_, &sensed_.q, asked_.posture_error,
               generator_.references().posture.velocity()};
  }
  return {snapshot_.tick,
          sensed_,
          springs ? tank_.share() : 0,
          {springs ? tank_.active(designed_.now(setpoints_.gains().now())) : brake_,
           designed_.null_space(), springs ? friction_left_ : viscous_friction_, wrenches, posture},
          setpoints_.changes(),
          setpoints_.attachment().now()};
}

void ControllerCore::show() noexcept {
  const Impedance& impedance = aim_ == Aim::kSprings ? setpoints_.gains().now() : brake_;
  const SpringReferences& references = generator_.references();
  Snapshot& shown = snapshot_;
  shown.mode = setpoints_.setpoint().mode;
  shown.joint_weight = impedance.joint_weight;
  shown.task_weight = impedance.task_weight;
  shown.position = sensed_.q;
  shown.velocity = sensed_.qd;
  shown.law_torque = filter_.asked();
  shown.tip = {sensed_.robot.p_BT_B, sensed_.robot.R_BT};
  const JointReference& path = shown.mode == Mode::kJoint ? references.joint : references.posture;
  const bool springs = impedance.joint_weight > 0 || impedance.task_weight > 0;
  shown.reference_position = springs ? path.position() : sensed_.q;
  shown.reference_velocity = path.velocity();
  if (!springs) shown.reference_velocity.setZero();
  for (int i = 0; i < n_; ++i) shown.joint_error[i] = shown.reference_position[i] - sensed_.q[i];
  if (impedance.task_weight > 0) {
    shown.reference_tip = {references.tip.position(), references.tip.rotation().toRotationMatrix()};
    shown.reference_twist = references.tip.velocity();
  } else {
    shown.reference_tip = shown.tip;
    shown.reference_twist.setZero();
  }
  shown.tip_error = asked_.tip_error;
  shown.tip_wrench = asked_.tip_wrench;
  shown.joint_damping_ratio = impedance.joint_damping_ratio;
  shown.task_damping_ratio =
      impedance.damping_ratio + impedance.common_ratio * impedance.null_damping_ratio;
  shown.damping_level = level_.level;
  if (tank_.on()) shown.energy_store = tank_.level();
  shown.spring_share = tank_.share();
  shown.payload = setpoints_.attachment().now().payload();
  shown.tool = setpoints_.attachment().now().tool;
  if (!integral_.on()) return;
  shown.integral_torque = integral_.torque();
  shown.integral_wrench = integral_.wrench();
}

Status ControllerCore::finish(Status status, const JointVector& torque) noexcept {
  snapshot_.torque = torque;
  if (tank_.on()) tank_.apply(torque);
  snapshot_.status = status;
  snapshot_.fault = faults_.fault();
  analysis_.collect();
  const bool good = status < Status::kStateNotFinite;
  if (good && analysis_.due(snapshot_.tick)) analysis_.update(loop());
  return status;
}

}  // namespace dashpot::controller
