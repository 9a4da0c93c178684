#include <dashpot/controller/core/controller_core.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kMostRestarts = 3;

int gain_ticks(const Settings& settings) {
  return static_cast<int>(std::lround(settings.motion.gain_time / settings.period));
}

/// Whole ns, which add up without rounding errors.
double nanoseconds(double seconds) noexcept {
  return std::round(1e9 * seconds);
}

}  // namespace

ControllerCore::ControllerCore(const RobotModel& model, const Settings& settings)
    : n_(model.dof()),
      settings_(settings),
      vibration_(settings),
      kernel_(model),
      state_check_(model, settings),
      motion_watch_(model, settings),
      references_(settings.motion, settings.period),
      gains_(gain_ticks(settings), Impedance(n_)),
      attachment_(gain_ticks(settings), model.attachment()),
      wrench_(gain_ticks(settings), Vector6::Zero()),
      designed_(settings.subtract_friction ? model.joint_values(&Joint::viscous_friction)
                                           : JointVector(JointVector::Zero(n_))),
      law_(model, settings.feed_forward),
      filter_(settings, least_joint_inertia(unloaded(model), settings.limits.position_lower,
                                            settings.limits.position_upper)),
      clamp_{settings.limits.linear_error, settings.limits.angular_error},
      damping_(filter_.borne(settings.limits.damping)),
      viscous_friction_(model.joint_values(&Joint::viscous_friction)),
      turn_(JointVector::Zero(n_)),
      q_(turn_),
      qd_(turn_),
      weight_(turn_),
      goal_(turn_),
      outside_(!settings.environment.none()),
      combined_(n_) {
  if (settings.analysis.sampled.interval > 0) {
    sampled_ = std::make_unique<SampledAnalysis>(model, settings);
  }
  for (int i = 0; i < n_; ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    if (joint.type == JointType::kContinuous) turn_[i] = 2 * std::numbers::pi;
  }
  reset(JointVector());
}

void ControllerCore::reset(const JointVector& torque) noexcept {
  state_check_.reset();
  motion_watch_.reset();
  if (torque.size() == n_ && torque.allFinite()) {
    filter_.reset(torque);
  } else {
    filter_.restart();
  }
  release();
  accepted_ = settings_.initial;
  look_.reset();
  first_ = true;
  ramp_ticks_ = 0;
  restarts_ = 0;
  attachment_.start(attachment_.target());
  kernel_.attach(attachment_.now());
  snapshot_ = Snapshot();
  for (JointVector* vector :
       {&snapshot_.position, &snapshot_.velocity, &snapshot_.torque, &snapshot_.law_torque,
        &snapshot_.reference_position, &snapshot_.reference_velocity, &snapshot_.joint_error}) {
    vector->setZero(n_);
  }
  external_wrench_.setZero();
  vibration_.reset(n_);
  designed_.reset();
  loop_.reset();
  analysed_.reset();
  if (sampled_) sampled_->reset();
}

void ControllerCore::release() noexcept {
  fault_ = Status::kOk;
  rest_ = 0;
  state_check_.trust_velocities();
  springs_ = Springs::kOff;
  accepted_.wrench = settings_.initial.wrench;
  accepted_.joint_position = settings_.initial.joint_position;
  from_user_ = false;  // springs start where the robot is, with the gains in force
}

Status ControllerCore::update(const RobotState& state, const Setpoint* setpoint,
                              JointVector& torque) noexcept {
  ++snapshot_.tick;
  snapshot_.time = state.time;
  const Status input = state_check_.check(state);
  if (input >= Status::kStateNotFinite) {
    show_measured(state);
    rest_ = 0;
    if (!first_ && state_check_.age() > settings_.watchdog.longest_gap) latch(input);
    return ramp(input, torque);
  }
  const double dt = first_ ? settings_.period : std::max(settings_.period, state_check_.age());
  setpoint_age_ = first_ ? 0 : setpoint_age_ + nanoseconds(dt);
  time_ = state.time;
  q_ = state_check_.position();
  qd_ = state_check_.velocity();
  const bool wrench_known = state.external_wrench.allFinite();
  if (wrench_known) external_wrench_ = state.external_wrench;
  step_attachment();
  kernel_.evaluate(q_, qd_, robot_);
  if (settings_.feed_forward.gravity) weight_ = robot_.gravity;
  filter_.assume(weight_);
  first_ = false;

  Status status = wrench_known ? Status::kOk : Status::kWrenchNotFinite;
  if (setpoint != nullptr && !accept_setpoint(*setpoint)) {
    status = worse(status, Status::kSetpointRejected);
  }
  status = worse(status, setpoint_age_status());
  // A reflex that has lost its sensor protects nobody.
  const bool blind = !wrench_known && std::isfinite(settings_.limits.external_force);
  status = worse(status, watch_motion(blind ? worse(input, Status::kCollision) : input, dt));
  if (status >= Status::kSetpointLost) {
    damping_torque(torque);
  } else {
    impedance_torque(status == Status::kSetpointStale, torque);
  }
  const bool springs = springs_ != Springs::kOff, returns = fault_ == Status::kPositionLimit;
  status = worse(status, filter_.apply({q_, qd_, motion_watch_.tip_speed(), springs, returns},
                                       weight_, torque));
  motion_watch_.applied(torque, weight_);
  if (status == Status::kNotFinite) {
    if (++ramp_ticks_ * settings_.period > settings_.watchdog.longest_gap) latch(status);
  } else {
    ramp_ticks_ = 0;
  }
  fill_snapshot();
  return finish(status, torque);
}

Status ControllerCore::watch_motion(Status input, double dt) noexcept {
  restarts_ = std::max(0.0, restarts_ - dt);
  const bool still = references_still();
  Status now = worse(input, motion_watch_.check({dt, q_, qd_, robot_, external_wrench_, still}));
  if (restarts_ > kMostRestarts) now = worse(now, Status::kTooManyRestarts);
  if (latches(now)) {
    latch(now);
    rest_ = 0;
  } else if (fault_ != Status::kOk && rested(dt)) {
    release();
  }
  return fault_ == Status::kOk ? Status::kOk : worse(now, Status::kFaultLatched);
}

void ControllerCore::latch(Status fault) noexcept {
  if (fault_ == Status::kOk) fault_ = fault;
  if (springs_ == Springs::kInForce) springs_ = Springs::kEnding;
}

bool ControllerCore::rested(double dt) noexcept {
  constexpr double kAtRest = 0.01;  // of the velocity limits
  const double wanted = settings_.watchdog.release_after;
  if (wanted == 0) return false;
  rest_ = dt > settings_.watchdog.longest_gap ? 0 : rest_ + dt;
  for (int i = 0; i < n_; ++i) {
    if (std::abs(qd_[i]) > kAtRest * settings_.limits.velocity[i]) rest_ = 0;
  }
  return rest_ >= wanted;
}

void ControllerCore::damping_torque(JointVector& tau) noexcept {
  if (springs_ != Springs::kOff || ramp_ticks_ > 0) filter_.begin_anew();
  springs_ = Springs::kOff;
  tau = weight_;
  if (motion_watch_.sees_frozen()) return;  // the velocity means nothing
  for (int i = 0; i < n_; ++i) tau[i] -= damping_[i] * qd_[i];
}

Status ControllerCore::ramp(Status status, JointVector& tau) noexcept {
  if (++ramp_ticks_ * settings_.period > settings_.watchdog.longest_gap) latch(status);
  filter_.ramp(tau);
  if (!first_) motion_watch_.applied(tau, weight_);
  return finish(status, tau);
}

Status ControllerCore::finish(Status status, const JointVector& tau) noexcept {
  snapshot_.torque = tau;
  snapshot_.status = status;
  snapshot_.fault = fault_;
  vibration_.collect();
  if (status >= Status::kStateNotFinite) return status;
  if (vibration_.due(snapshot_.tick)) analyse();
  if (sampled_ && sampled_->due(snapshot_.tick)) hand_over();
  return status;
}

/// What was measured, as far as it is numbers; all else in the snapshot stays that of the last good
/// state.
void ControllerCore::show_measured(const RobotState& state) noexcept {
  if (state.position.size() == n_ && state.position.allFinite()) {
    snapshot_.position = state.position;
  }
  if (state.velocity.size() == n_ && state.velocity.allFinite()) {
    snapshot_.velocity = state.velocity;
  }
}

void ControllerCore::fill_snapshot() noexcept {
  const Impedance& impedance = gains_.now();
  const bool springs = springs_ != Springs::kOff;
  snapshot_.mode = accepted_.mode;
  snapshot_.joint_weight = springs ? impedance.joint_weight : 0;
  snapshot_.task_weight = springs ? impedance.task_weight : 0;
  snapshot_.position = q_;
  snapshot_.velocity = qd_;
  snapshot_.law_torque = filter_.asked();
  snapshot_.tip = {robot_.p_BT_B, robot_.R_BT};
  if (snapshot_.joint_weight > 0 || snapshot_.task_weight > 0) {
    const JointReference& path =
        accepted_.mode == Mode::kJoint ? references_.joint : references_.posture;
    snapshot_.reference_position = path.position();
    snapshot_.reference_velocity = path.velocity();
  } else {
    snapshot_.reference_position = q_;
    snapshot_.reference_velocity.setZero();
  }
  for (int i = 0; i < n_; ++i) {
    snapshot_.joint_error[i] = snapshot_.reference_position[i] - q_[i];
  }
  if (snapshot_.task_weight > 0) {
    snapshot_.reference_tip = {references_.tip.position(),
                               references_.tip.rotation().toRotationMatrix()};
    snapshot_.reference_twist = references_.tip.velocity();
    snapshot_.tip_error = law_.tip_error();
  } else {
    snapshot_.reference_tip = snapshot_.tip;
    snapshot_.reference_twist.setZero();
    snapshot_.tip_error.setZero();
  }
  snapshot_.joint_damping_ratio = springs ? impedance.joint_damping_ratio : 0;
  snapshot_.task_damping_ratio = springs ? impedance.damping_ratio : 0;
  snapshot_.payload = attachment_.now().payload();
  snapshot_.tool = attachment_.now().tool;
  snapshot_.tip_wrench = springs ? law_.tip_wrench() : Vector6(Vector6::Zero());
}

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
    loop_.form(robot_, impedance(), law_.null_space(), viscous_friction_, task.system);
    task.springs = task.system.stiffness_factor.rows() > 0;
  }
  vibration_.update();
}

bool ControllerCore::loop_unchanged(bool with_wrench, bool with_velocity) noexcept {
  Analysed now{springs_ != Springs::kOff,
               false,
               gains_.changes() + attachment_.changes(),
               q_,
               {},
               Vector6::Zero()};
  if (with_velocity) now.qd = qd_;
  if (with_wrench) now.wrench = external_wrench_ + wrench_.now();
  bool same = false, settled = false;
  if (analysed_) {
    now.gains_moved = analysed_->gain_changes != now.gain_changes;
    settled = analysed_->gains_moved && !now.gains_moved;
    same = !now.gains_moved && analysed_->springs == now.springs && analysed_->q == now.q &&
           analysed_->qd.size() == now.qd.size() && analysed_->qd == now.qd &&
           analysed_->wrench == now.wrench;
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
  sampled_->hand_over();
}

const Impedance& ControllerCore::impedance() noexcept {
  const bool springs = springs_ != Springs::kOff, repels = filter_.repels(q_);
  if (springs && !repels && !outside_) return designed_.now(gains_.now());
  combined_ = springs ? designed_.now(gains_.now()) : Impedance(n_);
  if (!springs && !motion_watch_.sees_frozen()) combined_.joint_damping.diagonal() = damping_;
  if (repels) {
    filter_.add_repulsion(q_, springs, combined_.joint_stiffness, combined_.joint_damping);
    combined_.joint_weight = 1;  // there are joint springs
  }
  if (outside_) add_environment(settings_.environment, combined_);
  return combined_;
}

void ControllerCore::closed_loop(analysis::System<kMaxJoints>& system) noexcept {
  const TaskTerms& terms = settings_.task_terms;
  JointMatrix load;
  StiffnessTerms more{terms.jacobian_rate};
  if (terms.load != Load::kIgnored && !external_wrench_.isZero(0)) {
    const bool springs = springs_ != Springs::kOff;
    const bool pushes = springs && settings_.feed_forward.wrench;
    const TipWrenches wrenches{external_wrench_, pushes ? wrench_.now() : Vector6::Zero().eval()};
    load =
        stiffness_under_load(robot_, springs ? gains_.now() : Impedance(n_), terms.load, wrenches);
    more.load = &load;
  }
  controller::closed_loop(robot_, qd_, impedance(), law_.null_space(), viscous_friction_, more,
                          system);
}

}  // namespace dashpot::controller
