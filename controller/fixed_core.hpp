#pragma once
#include <dashpot/controller/closed_loop.hpp>
#include <dashpot/controller/controller_core.hpp>
#include <dashpot/controller/impedance_law.hpp>
#include <dashpot/controller/safety_filter.hpp>
#include <dashpot/controller/setpoint_follower.hpp>
#include <dashpot/controller/state_check.hpp>

#include <algorithm>
#include <cmath>

namespace dashpot::controller {

/// The controller's core for N joints, known at compile time. One tick, in `update`:
///     state -> StateCheck -> DynamicsKernel -> SetpointFollower -> ImpedanceLaw -> SafetyFilter
///           -> torque;   and every so often -> closed loop -> VibrationAnalysis
template <int N>
class FixedCore final : public ControllerCore {
 public:
  using Vector = Joints<N>;

  FixedCore(const RobotModel& model, const Settings& settings);

  Status update(const RobotState& state, const Setpoint& setpoint,
                JointVector& torque) noexcept override;
  void reset(const JointVector& torque) noexcept override;
  void closed_loop(analysis::System<kMaxJoints>& system) const noexcept override;

 private:
  /// Whether the state allows springs: kOk, kTimeGap, kVelocityLimit or kPositionLimit.
  Status guard(Status input) noexcept;
  /// Moves gains and set-points on by one period, and gives the law's torque.
  Vector act(bool hold) noexcept;
  /// The safe output without springs.
  Vector damp() noexcept;
  /// The safe output without a state.
  Status ramp(Status status, JointVector& torque) noexcept;
  /// One more tick of it; springs do not outlast a long one.
  void count_ramp() noexcept {
    if (++ramp_ticks_ * settings_.period > settings_.watchdog.longest_gap) follower_.stop();
  }
  Status finish(Status status, const Vector& tau, JointVector& torque) noexcept;
  void describe() noexcept;

  DynamicsKernel<N> kernel_;
  StateCheck state_check_;
  SetpointFollower<N> follower_;
  ImpedanceLaw<N> law_;
  SafetyFilter<N> filter_;
  Vector damping_;           ///< of the safe output "damp", N m s/rad
  Vector viscous_friction_;  ///< of the robot, N m s/rad

  // The last good state, and the robot there
  std::int64_t time_ = 0;
  Vector q_ = Vector::Zero();
  Vector qd_ = Vector::Zero();
  Vector6 external_wrench_ = Vector6::Zero();
  Dynamics<N> robot_;

  bool first_ = true;  ///< there was no good state yet
  bool too_fast_ = false;
  int ramp_ticks_ = 0;
};

template <int N>
FixedCore<N>::FixedCore(const RobotModel& model, const Settings& settings)
    : ControllerCore(settings),
      kernel_(model),
      state_check_(model, settings),
      follower_(model, settings),
      law_(model, settings.feed_forward),
      filter_(settings.limits, settings.period),
      damping_(fixed<N>(settings.limits.damping)),
      viscous_friction_(fixed<N>(model.joint_values(&Joint::damping))) {
  reset(JointVector::Zero(N));
}

template <int N>
void FixedCore<N>::reset(const JointVector& torque) noexcept {
  state_check_.reset();
  const bool usable = torque.size() == N && torque.allFinite();
  filter_.reset(usable ? fixed<N>(torque) : Vector(Vector::Zero()));
  follower_.reset();
  first_ = true;
  too_fast_ = false;
  ramp_ticks_ = 0;
  snapshot_ = Snapshot();
  for (JointVector* vector :
       {&snapshot_.position, &snapshot_.velocity, &snapshot_.torque, &snapshot_.law_torque,
        &snapshot_.setpoint_position, &snapshot_.setpoint_velocity, &snapshot_.joint_error}) {
    vector->setZero(N);
  }
  vibration_.reset(N);
}

template <int N>
Status FixedCore<N>::update(const RobotState& state, const Setpoint& setpoint,
                            JointVector& torque) noexcept {
  ++snapshot_.tick;
  snapshot_.time = state.time;
  const Status input = state_check_.check(state);
  if (input >= Status::kStateNotFinite) return ramp(input, torque);
  time_ = state.time;
  q_ = fixed<N>(state_check_.position());
  qd_ = fixed<N>(state.velocity);
  external_wrench_ = state.external_wrench;
  kernel_.evaluate(q_, qd_, robot_);
  if (first_) {
    follower_.begin(time_);
    first_ = false;
  }

  const bool in_order = follower_.read(setpoint, time_, q_, robot_);
  Status status = in_order ? Status::kOk : Status::kSetpointRejected;
  status = worse(status, follower_.watch(time_));
  status = worse(status, guard(input));
  Vector tau = status >= Status::kSetpointLost ? damp() : act(status == Status::kSetpointStale);
  status = worse(status, filter_.apply(q_, qd_, tau));
  if (status == Status::kNotFinite) {
    count_ramp();
  } else {
    ramp_ticks_ = 0;
  }
  describe();
  return finish(status, tau, torque);
}

template <int N>
Status FixedCore<N>::guard(Status input) noexcept {
  double share = 0;
  for (int i = 0; i < N; ++i) {
    share = std::max(share, std::abs(qd_[i]) / settings_.limits.velocity[i]);
  }
  too_fast_ = share > 1 || (too_fast_ && share > 0.8);
  Status status = input;
  if (too_fast_) status = worse(status, Status::kVelocityLimit);
  if (filter_.outside(q_)) status = worse(status, Status::kPositionLimit);
  return status;
}

template <int N>
Joints<N> FixedCore<N>::act(bool hold) noexcept {
  if (!follower_.running()) {
    follower_.start(q_, robot_);
    ++snapshot_.restarts;
  }
  follower_.step(hold);
  return law_.torque(robot_, q_, qd_, follower_.impedance(), follower_.paths(), follower_.wrench());
}

template <int N>
Joints<N> FixedCore<N>::damp() noexcept {
  follower_.stop();
  Vector tau = Vector::Zero();
  if (settings_.feed_forward.gravity) add<N>(robot_.gravity, tau);
  for (int i = 0; i < N; ++i) tau[i] -= damping_[i] * qd_[i];
  return tau;
}

template <int N>
Status FixedCore<N>::ramp(Status status, JointVector& torque) noexcept {
  count_ramp();
  return finish(status, filter_.ramp(), torque);
}

template <int N>
Status FixedCore<N>::finish(Status status, const Vector& tau, JointVector& torque) noexcept {
  copy<N>(tau, torque);
  copy<N>(tau, snapshot_.torque);
  snapshot_.status = status;
  if (status < Status::kStateNotFinite && vibration_.due(snapshot_.tick)) {
    closed_loop(vibration_.system());
    vibration_.update(time_, snapshot_.tick, snapshot_.position);
  }
  return status;
}

template <int N>
void FixedCore<N>::describe() noexcept {
  const bool springs = follower_.running();
  const SpringPaths<N>& paths = follower_.paths();
  snapshot_.mode = follower_.mode();
  snapshot_.joint_weight = springs ? follower_.impedance().joint_weight : 0;
  snapshot_.task_weight = springs ? follower_.impedance().task_weight : 0;
  copy<N>(q_, snapshot_.position);
  copy<N>(qd_, snapshot_.velocity);
  copy<N>(filter_.asked(), snapshot_.law_torque);
  snapshot_.tip = {robot_.p_BT_B, robot_.R_BT};
  if (springs) {
    const JointPath<N>& path = follower_.mode() == Mode::kJoint ? paths.joint : paths.rest;
    copy<N>(path.position(), snapshot_.setpoint_position);
    copy<N>(path.velocity(), snapshot_.setpoint_velocity);
  } else {
    copy<N>(q_, snapshot_.setpoint_position);
    copy<N>(Vector::Zero(), snapshot_.setpoint_velocity);
  }
  for (int i = 0; i < N; ++i) {
    snapshot_.joint_error[i] = snapshot_.setpoint_position[i] - q_[i];
  }
  if (snapshot_.task_weight > 0) {
    snapshot_.setpoint_tip = {paths.tip.position(), paths.tip.rotation().toRotationMatrix()};
    snapshot_.setpoint_twist = paths.tip.velocity();
    snapshot_.tip_error = law_.tip_error();
  } else {
    snapshot_.setpoint_tip = snapshot_.tip;
    snapshot_.setpoint_twist.setZero();
    snapshot_.tip_error.setZero();
  }
  snapshot_.tip_wrench = springs ? law_.tip_wrench() : Vector6(Vector6::Zero());
}

template <int N>
void FixedCore<N>::closed_loop(analysis::System<kMaxJoints>& system) const noexcept {
  Impedance<N> impedance;
  if (follower_.running()) {
    impedance = follower_.impedance();
  } else {
    for (int i = 0; i < N; ++i) impedance.joint_damping(i, i) = damping_[i];
  }
  controller::closed_loop<N>(robot_, qd_, impedance, law_.null_space(), viscous_friction_,
                             settings_.task_terms, external_wrench_, system);
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
