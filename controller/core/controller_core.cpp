#include <dashpot/controller/core/controller_core.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {
namespace {

constexpr double kMostRestarts = 3;
constexpr double kReserve = 1.02;  // of the gain margin, for what couples modes

int gain_ticks(const Settings& settings) {
  return static_cast<int>(std::lround(settings.motion.gain_time / settings.period));
}

std::optional<analysis::BorneDamping> borne_damping(const RobotModel& model,
                                                    const Settings& settings) {
  const double margin = settings.limits.gain_margin;
  if (margin == 1) return {};
  return analysis::BorneDamping(sampled_loop(model, settings), kReserve * margin);
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
      borne_(borne_damping(model, settings)),
      designed_(settings.subtract_friction ? JointVector(friction_left(model, settings).cwiseMax(0))
                                           : JointVector(JointVector::Zero(n_)),
                borne_ ? &*borne_ : nullptr),
      law_(model, settings.feed_forward, SpringIntegral(settings.integral, settings.period),
           borne_ ? &*borne_ : nullptr),
      filter_(settings),
      clamp_{settings.limits.linear_error, settings.limits.angular_error},
      viscous_friction_(model.joint_values(&Joint::viscous_friction)),
      friction_left_(friction_left(model, settings)),
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
        &snapshot_.reference_position, &snapshot_.reference_velocity, &snapshot_.joint_error,
        &snapshot_.integral_torque}) {
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
  law_.integral().reset();
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
  // A stamp or two that say nothing change no torque.
  const bool odd_stamp =
      input == Status::kTimeBackward && state_check_.backward() <= settings_.watchdog.longest_gap;
  const Status seen = odd_stamp ? Status::kOk : input;
  status = worse(status, watch_motion(blind ? worse(seen, Status::kCollision) : seen, dt));
  SafetyFilter::Aim aim = SafetyFilter::Aim::kSprings;
  if (status >= Status::kSetpointLost) {
    aim = end_springs();
    torque = weight_;
  } else {
    impedance_torque(status == Status::kSetpointStale, torque);
    level_ = designed_.level();
    level_.include(law_.null_level());
    // While gains change, dampers that fade keep the margin as well.
    if (!level_.kept && gains_.still()) status = worse(status, Status::kLittleMargin);
  }
  const Status limits = filter_.apply(
      {q_, qd_, robot_, weight_, springs_ == Springs::kInForce ? law_.mass() : nullptr},
      motion_watch_.tip_speed(), aim, law_.dampers(), torque);
  if (springs_ == Springs::kInForce && law_.integral().on()) {
    integrate(limits, status == Status::kSetpointStale);
  }
  status = worse(status, limits);
  motion_watch_.applied(torque, weight_);
  if (status == Status::kNotFinite) {
    if (++ramp_ticks_ * settings_.period > settings_.watchdog.longest_gap) latch(status);
  } else {
    ramp_ticks_ = 0;
  }
  fill_snapshot();
  return finish(odd_stamp ? worse(status, input) : status, torque);
}

Status ControllerCore::watch_motion(Status input, double dt) noexcept {
  restarts_ = std::max(0.0, restarts_ - dt);
  const bool still = references_still();
  Status now = worse(input, motion_watch_.check({dt, q_, qd_, robot_, external_wrench_, still}));
  if (restarts_ > kMostRestarts) now = worse(now, Status::kTooManyRestarts);
  if (brake_fails(now)) now = fault_ = Status::kBrakeDoubted;
  if (latches(now)) {
    latch(now);
    rest_ = 0;
  } else if (fault_ != Status::kOk && rested(dt)) {
    release();
  }
  return fault_ == Status::kOk ? Status::kOk : worse(now, Status::kFaultLatched);
}

void ControllerCore::latch(Status fault) noexcept {
  if (fault_ == Status::kOk) {
    fault_ = fault;
    motion_watch_.forget_swings();  // those that come from now on are the brake's
  }
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

SafetyFilter::Aim ControllerCore::end_springs() noexcept {
  using Aim = SafetyFilter::Aim;
  law_.integral().reset();
  if (springs_ != Springs::kOff || ramp_ticks_ > 0) {
    filter_.begin_anew();
  }
  springs_ = Springs::kOff;
  const bool means_nothing = motion_watch_.sees_frozen();  // the velocity
  if (means_nothing || fault_ == Status::kBrakeDoubted) return Aim::kFloat;
  return fault_ == Status::kPositionLimit ? Aim::kReturn : Aim::kStop;
}

bool ControllerCore::brake_fails(Status now) noexcept {
  if (fault_ == Status::kBrakeDoubted || filter_.brake().feeds()) return true;
  if (springs_ != Springs::kOff || filter_.fades() || motion_watch_.sees_frozen()) return false;
  if (fault_ == Status::kOk || now != Status::kInstability) return false;
  motion_watch_.forget_swings();
  return !filter_.brake().soften();  // it shakes the arm
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
  snapshot_.damping_level = springs ? level_.level : 1;
  snapshot_.payload = attachment_.now().payload();
  snapshot_.tool = attachment_.now().tool;
  snapshot_.tip_wrench = springs ? law_.tip_wrench() : Vector6(Vector6::Zero());
  if (!law_.integral().on()) return;
  snapshot_.integral_torque = law_.integral().torque();
  snapshot_.integral_wrench = law_.integral().wrench();
}

}  // namespace dashpot::controller
