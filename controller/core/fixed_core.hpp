#pragma once
#include <dashpot/controller/core/controller_core.hpp>
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/law/impedance_law.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/controller/safety/motion_watch.hpp>
#include <dashpot/controller/safety/safety_filter_steps.hpp>
#include <dashpot/controller/safety/state_check.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/vibration/loop_system.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::controller {

/// The controller's core for N joints, known at compile time. One tick, in `update`:
///     state -> StateCheck -> DynamicsKernel -> MotionWatch -> set-point, references, gains
///           -> DesignedDamping -> ImpedanceLaw -> SafetyFilter -> torque;   and with these gains
///           -> LoopSystem -> VibrationAnalysis
template <int N>
class FixedCore final : public ControllerCore {
 public:
  using Vector = Joints<N>;

  FixedCore(const RobotModel& model, const Settings& settings);

  Status update(const RobotState& state, const Setpoint* setpoint,
                JointVector& torque) noexcept override;
  void reset(const JointVector& torque) noexcept override;
  void release() noexcept override;
  void closed_loop(analysis::System<kMaxJoints>& system) const noexcept override;

 private:
  static constexpr double kMostRestarts = 3;

  /// Takes over a set-point that is new and in order. Whether the one given is in order.
  bool accept_setpoint(const Setpoint& setpoint) noexcept;
  /// Springs that are to grow from zero start where the robot is.
  void start_new_springs() noexcept;
  /// Sets the goal of the accepted set-point. References whose springs are not in force start where
  /// the robot is.
  void update_goal() noexcept;
  /// Starts the springs where the robot is, with gains that grow from zero.
  void restart_springs() noexcept;
  /// Latches and releases faults. Returns kOk if the state allows springs, or kFaultLatched or
  /// worse.
  Status watch_motion(Status input, double dt) noexcept;
  /// True once the robot has been at rest for Watchdog::release_after.
  bool rested(double dt) noexcept;
  void latch(Status fault) noexcept;
  /// Whether the set-point is fresh: kOk, kSetpointStale or kSetpointLost.
  Status setpoint_age_status() const noexcept;
  /// Moves gains and references on by one period, and returns the law's torque.
  Vector impedance_torque(bool hold) noexcept;
  /// The safe output without springs.
  Vector damping_torque() noexcept;
  /// What is compensated here of the gravity torque, at the last good state.
  Vector weight() const noexcept {
    return settings_.feed_forward.gravity ? robot_.gravity : Vector(Vector::Zero());
  }
  double tip_reference_speed() const noexcept;
  /// True if all references are at rest.
  bool references_still() const noexcept;
  /// Whole ns, which add up without rounding errors.
  static double nanoseconds(double seconds) noexcept { return std::round(1e9 * seconds); }
  void show_measured(const RobotState& state) noexcept;
  /// The safe output without a state.
  Status ramp(Status status, JointVector& torque) noexcept;
  Status finish(Status status, const Vector& tau, JointVector& torque) noexcept;
  void fill_snapshot() noexcept;
  void analyse() noexcept;
  /// Hands the closed loop to the analysis of the sampled loop.
  void hand_over() noexcept;
  /// Whether the closed loop is that of the last analysis, exactly.
  bool loop_unchanged(bool with_wrench, bool with_velocity) noexcept;
  Impedance<N> damper() const noexcept;
  Impedance<N> impedance() const noexcept;

  DynamicsKernel<N> kernel_;
  StateCheck state_check_;
  SpringReferences<N> references_;
  GainBlend<N> gains_;
  DesignedDamping<N> designed_;
  Ramp<Vector6> wrench_;
  ImpedanceLaw<N> law_;
  SafetyFilter<N> filter_;
  MotionWatch<N> motion_watch_;
  ErrorClamp clamp_;
  Vector damping_;           ///< of the safe output "damp", N m s/rad
  Vector viscous_friction_;  ///< of the robot, N m s/rad
  Vector turn_;              ///< 2 pi for a continuous joint, else 0

  // The last good state, and the robot there
  std::int64_t time_ = 0;
  double setpoint_age_ = 0;  ///< ns, counted on, whatever the clock does after it was accepted
  Vector q_ = Vector::Zero();
  Vector qd_ = Vector::Zero();
  Vector6 external_wrench_ = Vector6::Zero();
  Dynamics<N> robot_;

  LoopSystem<N> loop_;
  struct {
    bool any = false, damping_only = false;
    bool gains_moved = false;
    std::uint64_t gain_changes = 0;
    Vector q, qd;  ///< qd and wrench: zero where they do not matter
    Vector6 wrench;
  } analysed_;  ///< what the last analysis was of

  Setpoint accepted_;             ///< the last good set-point
  Vector goal_ = Vector::Zero();  ///< its joint position
  Eigen::Quaterniond goal_rotation_ = Eigen::Quaterniond::Identity();
  bool from_user_ = false;      ///< or else it is Settings::initial, where the robot started
  bool looked_at_any_ = false;  ///< and at what time that was, and whether it was in order:
  std::int64_t looked_at_ = 0;
  bool in_order_ = true;

  bool first_ = true;           ///< there was no good state yet
  bool restart_ = true;         ///< springs restart when they are next in force
  bool damping_only_ = true;    ///< the last torque was that of `damping_torque`
  Status fault_ = Status::kOk;  ///< that latched
  double rest_ = 0;             ///< for how long the robot has been at rest since, s
  double restarts_ = 0;         ///< of the last second or so
  int ramp_ticks_ = 0;
};

template <int N>
FixedCore<N>::FixedCore(const RobotModel& model, const Settings& settings)
    : ControllerCore(model, settings),
      kernel_(model),
      state_check_(model, settings),
      references_([&] {
        const Motion& motion = settings.motion;
        const double T = settings.period;
        const int window = static_cast<int>(std::lround(motion.smoothing / T));
        const JointNorm<N> joints{fixed<N>(motion.velocity), fixed<N>(motion.acceleration)};
        const TwistNorm twist{motion.linear_velocity, motion.angular_velocity,
                              motion.linear_acceleration, motion.angular_acceleration};
        return SpringReferences<N>{JointReference<N>(joints, T, window),
                                   JointReference<N>(joints, T, window),
                                   TipReference(twist, T, window)};
      }()),
      gains_(static_cast<int>(std::lround(settings.motion.gain_time / settings.period))),
      designed_(settings.subtract_friction ? fixed<N>(model.joint_values(&Joint::viscous_friction))
                                           : Vector(Vector::Zero())),
      wrench_(static_cast<int>(std::lround(settings.motion.gain_time / settings.period))),
      law_(model, settings.feed_forward),
      filter_(settings, fixed<N>(least_joint_inertia(model, settings.limits.position_lower,
                                                     settings.limits.position_upper))),
      motion_watch_(model, settings),
      clamp_{settings.limits.linear_error, settings.limits.angular_error},
      damping_(filter_.borne(fixed<N>(settings.limits.damping))),
      viscous_friction_(fixed<N>(model.joint_values(&Joint::viscous_friction))) {
  for (int i = 0; i < N; ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    turn_[i] = joint.type == JointType::kContinuous ? 2 * std::numbers::pi : 0;
  }
  reset(JointVector());
}

template <int N>
void FixedCore<N>::reset(const JointVector& torque) noexcept {
  state_check_.reset();
  motion_watch_.reset();
  if (torque.size() == N && torque.allFinite()) {
    filter_.reset(fixed<N>(torque));
  } else {
    filter_.restart();
  }
  release();
  accepted_ = settings_.initial;
  looked_at_any_ = false;
  in_order_ = first_ = true;
  ramp_ticks_ = 0;
  restarts_ = 0;
  snapshot_ = Snapshot();
  for (JointVector* vector :
       {&snapshot_.position, &snapshot_.velocity, &snapshot_.torque, &snapshot_.law_torque,
        &snapshot_.reference_position, &snapshot_.reference_velocity, &snapshot_.joint_error}) {
    vector->setZero(N);
  }
  external_wrench_.setZero();
  vibration_.reset(N);
  designed_.reset();
  loop_.reset();
  analysed_.any = false;
  if (sampled_) sampled_->reset();
}

template <int N>
void FixedCore<N>::release() noexcept {
  fault_ = Status::kOk;
  rest_ = 0;
  state_check_.trust_velocities();
  restart_ = damping_only_ = true;
  accepted_.wrench = settings_.initial.wrench;
  accepted_.joint_position = settings_.initial.joint_position;
  from_user_ = false;  // springs start where the robot is, with the gains in force
}

template <int N>
Status FixedCore<N>::update(const RobotState& state, const Setpoint* setpoint,
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
  q_ = fixed<N>(state_check_.position());
  qd_ = fixed<N>(state_check_.velocity());
  const bool wrench_known = state.external_wrench.allFinite();
  if (wrench_known) external_wrench_ = state.external_wrench;
  kernel_.evaluate(q_, qd_, robot_);
  const Vector weight = this->weight();
  filter_.assume(weight);
  first_ = false;

  Status status = wrench_known ? Status::kOk : Status::kWrenchNotFinite;
  if (setpoint != nullptr && !accept_setpoint(*setpoint)) {
    status = worse(status, Status::kSetpointRejected);
  }
  status = worse(status, setpoint_age_status());
  // A reflex that has lost its sensor protects nobody.
  const bool blind = !wrench_known && std::isfinite(settings_.limits.external_force);
  status = worse(status, watch_motion(blind ? worse(input, Status::kCollision) : input, dt));
  Vector tau = status >= Status::kSetpointLost ? damping_torque()
                                               : impedance_torque(status == Status::kSetpointStale);
  const bool returns = fault_ == Status::kPositionLimit;
  status = worse(
      status,
      filter_.apply({q_, qd_, motion_watch_.tip_speed(), !damping_only_, returns}, weight, tau));
  motion_watch_.applied(tau, difference<N>(tau, weight));
  if (status == Status::kNotFinite) {
    if (++ramp_ticks_ * settings_.period > settings_.watchdog.longest_gap) latch(status);
  } else {
    ramp_ticks_ = 0;
  }
  fill_snapshot();
  return finish(status, tau, torque);
}

template <int N>
Status FixedCore<N>::watch_motion(Status input, double dt) noexcept {
  restarts_ = std::max(0.0, restarts_ - dt);
  const bool still = references_still();
  const Status motion = motion_watch_.check({dt, q_, qd_, robot_, external_wrench_, still});
  Status now = worse(input, motion);
  if (restarts_ > kMostRestarts) now = worse(now, Status::kTooManyRestarts);
  if (latches(now)) {
    latch(now);
    rest_ = 0;
  } else if (fault_ != Status::kOk && rested(dt)) {
    release();
  }
  return fault_ == Status::kOk ? Status::kOk : worse(now, Status::kFaultLatched);
}

template <int N>
void FixedCore<N>::latch(Status fault) noexcept {
  if (fault_ == Status::kOk) fault_ = fault;
  restart_ = true;
}

template <int N>
bool FixedCore<N>::rested(double dt) noexcept {
  constexpr double kAtRest = 0.01;  // of the velocity limits
  const double wanted = settings_.watchdog.release_after;
  if (wanted == 0) return false;
  rest_ = dt > settings_.watchdog.longest_gap ? 0 : rest_ + dt;
  for (int i = 0; i < N; ++i) {
    if (std::abs(qd_[i]) > kAtRest * settings_.limits.velocity[i]) rest_ = 0;
  }
  return rest_ >= wanted;
}

template <int N>
Joints<N> FixedCore<N>::damping_torque() noexcept {
  if (!damping_only_ || ramp_ticks_ > 0) filter_.begin_anew();
  restart_ = damping_only_ = true;
  Vector tau = Vector::Zero();
  if (settings_.feed_forward.gravity) add<N>(robot_.gravity, tau);
  if (motion_watch_.sees_frozen()) return tau;  // the velocity means nothing
  for (int i = 0; i < N; ++i) tau[i] -= damping_[i] * qd_[i];
  return tau;
}

/// What was measured, as far as it is numbers; all else in the snapshot stays that of the last good
/// state.
template <int N>
void FixedCore<N>::show_measured(const RobotState& state) noexcept {
  if (state.position.size() == N && state.position.allFinite()) snapshot_.position = state.position;
  if (state.velocity.size() == N && state.velocity.allFinite()) snapshot_.velocity = state.velocity;
}

template <int N>
Status FixedCore<N>::ramp(Status status, JointVector& torque) noexcept {
  if (++ramp_ticks_ * settings_.period > settings_.watchdog.longest_gap) latch(status);
  const Vector tau = filter_.ramp();
  if (!first_) motion_watch_.applied(tau, difference<N>(tau, weight()));
  return finish(status, tau, torque);
}

template <int N>
Status FixedCore<N>::finish(Status status, const Vector& tau, JointVector& torque) noexcept {
  copy<N>(tau, torque);
  copy<N>(tau, snapshot_.torque);
  snapshot_.status = status;
  snapshot_.fault = fault_;
  vibration_.collect();
  if (status >= Status::kStateNotFinite) return status;
  if (vibration_.due(snapshot_.tick)) analyse();
  if (sampled_ && sampled_->due(snapshot_.tick)) hand_over();
  return status;
}

template <int N>
void FixedCore<N>::fill_snapshot() noexcept {
  const Impedance<N>& impedance = gains_.now();
  const bool springs = !damping_only_;
  snapshot_.mode = accepted_.mode;
  snapshot_.joint_weight = springs ? impedance.joint_weight : 0;
  snapshot_.task_weight = springs ? impedance.task_weight : 0;
  copy<N>(q_, snapshot_.position);
  copy<N>(qd_, snapshot_.velocity);
  copy<N>(filter_.asked(), snapshot_.law_torque);
  snapshot_.tip = {robot_.p_BT_B, robot_.R_BT};
  if (snapshot_.joint_weight > 0 || snapshot_.task_weight > 0) {
    const JointReference<N>& path =
        accepted_.mode == Mode::kJoint ? references_.joint : references_.posture;
    copy<N>(path.position(), snapshot_.reference_position);
    copy<N>(path.velocity(), snapshot_.reference_velocity);
  } else {
    copy<N>(q_, snapshot_.reference_position);
    copy<N>(Vector::Zero(), snapshot_.reference_velocity);
  }
  for (int i = 0; i < N; ++i) {
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
  snapshot_.tip_wrench = springs ? law_.tip_wrench() : Vector6(Vector6::Zero());
}

extern template class FixedCore<1>;
extern template class FixedCore<2>;
extern template class FixedCore<3>;
extern template class FixedCore<4>;
extern template class FixedCore<5>;
extern template class FixedCore<6>;
extern template class FixedCore<7>;
extern template class FixedCore<8>;
extern template class FixedCore<9>;
extern template class FixedCore<10>;
extern template class FixedCore<11>;
extern template class FixedCore<12>;
extern template class FixedCore<13>;
extern template class FixedCore<14>;
extern template class FixedCore<15>;
extern template class FixedCore<16>;

}  // namespace dashpot::controller
