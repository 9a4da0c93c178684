#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/gain_path.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/controller/setpoint_path.hpp>
#include <dashpot/controller/settings.hpp>
#include <dashpot/controller/state_check.hpp>
#include <dashpot/controller/status.hpp>

#include <cmath>
#include <numbers>

namespace dashpot::controller {

/// Leads springs and dampers from where they are to where the user wants them: takes over
/// set-points that are in order, and moves goals, gains and wrench there at their limited rates.
template <int N>
class SetpointFollower {
 public:
  SetpointFollower(const RobotModel& model, const Settings& settings);

  /// Forgets everything; the next set-point in force is Settings::initial, where the robot is then,
  /// given at the time of the next `begin`.
  void reset() noexcept;
  /// The first good state came.
  void begin(std::int64_t time) noexcept;

  /// Takes over a set-point that is new and in order. Whether the one given is in order.
  bool read(const Setpoint& setpoint, std::int64_t time, const Joints<N>& q,
            const Dynamics<N>& robot) noexcept;
  /// Age of the set-point in force: kOk, kSetpointStale or kSetpointLost.
  Status watch(std::int64_t time) const noexcept;

  /// Springs where the robot is, gains growing from zero.
  void start(const Joints<N>& q, const Dynamics<N>& robot) noexcept;
  /// No springs until the next start.
  void stop() noexcept { running_ = false; }
  bool running() const noexcept { return running_; }
  /// One period further; with `hold` everything brakes and stays where it is.
  void step(bool hold) noexcept;

  Mode mode() const noexcept { return accepted_.mode; }
  const SpringPaths<N>& paths() const noexcept { return paths_; }
  const Impedance<N>& impedance() const noexcept { return gains_.now(); }
  const Vector6& wrench() const noexcept { return wrench_.now(); }

 private:
  /// The way to the accepted set-point; paths whose springs are not in force start where the robot
  /// is.
  void aim(const Joints<N>& q, const Dynamics<N>& robot) noexcept;

  Limits limits_;
  Watchdog watchdog_;
  Setpoint initial_;
  Joints<N> turn_;  ///< 2 pi for a continuous joint, else 0
  SpringPaths<N> paths_;
  GainPath<N> gains_;
  Ramp<Vector6> wrench_;

  Setpoint accepted_;                   ///< the last good set-point
  Joints<N> goal_ = Joints<N>::Zero();  ///< its joint position
  Eigen::Quaterniond goal_rotation_ = Eigen::Quaterniond::Identity();
  bool from_user_ = false;  ///< or else it is Settings::initial
  bool running_ = false;
  bool looked_at_any_ = false;  ///< and at what time that was, and whether it was in order:
  std::int64_t looked_at_ = 0;
  bool in_order_ = true;
};

template <int N>
SpringPaths<N> spring_paths(const Motion& motion, double period) noexcept {
  const int window = static_cast<int>(std::lround(motion.smoothing / period));
  const JointNorm<N> joints{fixed<N>(motion.velocity), fixed<N>(motion.acceleration)};
  const TwistNorm twist{motion.linear_velocity, motion.angular_velocity, motion.linear_acceleration,
                        motion.angular_acceleration};
  return {JointPath<N>(joints, period, window), JointPath<N>(joints, period, window),
          TipPath(twist, period, window)};
}

template <int N>
SetpointFollower<N>::SetpointFollower(const RobotModel& model, const Settings& settings)
    : limits_(settings.limits),
      watchdog_(settings.watchdog),
      initial_(settings.initial),
      paths_(spring_paths<N>(settings.motion, settings.period)),
      gains_(static_cast<int>(std::lround(settings.motion.gain_time / settings.period))),
      wrench_(static_cast<int>(std::lround(settings.motion.gain_time / settings.period))) {
  for (int i = 0; i < N; ++i) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(i)];
    turn_[i] = joint.type == JointType::kContinuous ? 2 * std::numbers::pi : 0;
  }
  reset();
}

template <int N>
void SetpointFollower<N>::reset() noexcept {
  accepted_ = initial_;
  from_user_ = running_ = looked_at_any_ = false;
  in_order_ = true;
}

template <int N>
void SetpointFollower<N>::begin(std::int64_t time) noexcept {
  accepted_.time = time;
}

template <int N>
bool SetpointFollower<N>::read(const Setpoint& setpoint, std::int64_t time, const Joints<N>& q,
                               const Dynamics<N>& robot) noexcept {
  if (looked_at_any_ && setpoint.time == looked_at_) return in_order_;
  looked_at_any_ = true;
  looked_at_ = setpoint.time;
  const bool same = setpoint.mode == accepted_.mode && same_gains(setpoint.gains, accepted_.gains);
  const double hold = watchdog_.setpoint_hold;
  const bool to_come = hold > 0 && seconds_between(time, setpoint.time) > hold;
  in_order_ = !to_come && !check_setpoint(setpoint, limits_, same);
  if (!in_order_) return false;
  accepted_.time = setpoint.time;
  accepted_.joint_position = setpoint.joint_position;
  accepted_.tip_pose = setpoint.tip_pose;
  accepted_.wrench = setpoint.wrench;
  from_user_ = true;
  if (!same) {
    accepted_.mode = setpoint.mode;
    accepted_.gains = setpoint.gains;
    gains_.set_target(Impedance<N>::of(accepted_));
  }
  if (running_) aim(q, robot);
  return true;
}

template <int N>
void SetpointFollower<N>::aim(const Joints<N>& q, const Dynamics<N>& robot) noexcept {
  const bool joint = accepted_.mode == Mode::kJoint;
  if (joint && gains_.now().joint_weight == 0) paths_.joint.start(q);
  if (!joint && gains_.now().task_weight == 0) {
    paths_.rest.start(q);
    paths_.tip.start(robot.p_BT_B, Eigen::Quaterniond(robot.R_BT).normalized());
  }
  const Joints<N>& from = joint ? paths_.joint.position() : paths_.rest.position();
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
void SetpointFollower<N>::start(const Joints<N>& q, const Dynamics<N>& robot) noexcept {
  const Impedance<N> target = Impedance<N>::of(accepted_);
  Impedance<N> none;
  none.base.held = target.base.held;
  none.tool.held = target.tool.held;
  gains_.start(none);
  gains_.set_target(target);
  wrench_.start(Vector6::Zero());
  if (!from_user_) {
    copy<N>(q, accepted_.joint_position);
    accepted_.tip_pose = {robot.p_BT_B, robot.R_BT};
  }
  aim(q, robot);
  running_ = true;
}

template <int N>
Status SetpointFollower<N>::watch(std::int64_t time) const noexcept {
  const double age = seconds_between(accepted_.time, time);
  if (watchdog_.setpoint_damp > 0 && age > watchdog_.setpoint_damp) return Status::kSetpointLost;
  if (watchdog_.setpoint_hold > 0 && age > watchdog_.setpoint_hold) return Status::kSetpointStale;
  return Status::kOk;
}

template <int N>
void SetpointFollower<N>::step(bool hold) noexcept {
  gains_.step();
  const Vector6 wrench = hold ? Vector6(Vector6::Zero()) : accepted_.wrench;
  if (wrench != wrench_.target()) wrench_.set_target(wrench);
  wrench_.step();

  // Of two modes in force, the one that fades away stays where it is.
  const Impedance<N>& impedance = gains_.now();
  const bool joint = accepted_.mode == Mode::kJoint;
  if (impedance.joint_weight > 0) {
    if (joint && !hold) {
      paths_.joint.step(goal_);
    } else {
      paths_.joint.halt();
    }
  }
  if (impedance.task_weight > 0) {
    if (!joint && !hold) {
      paths_.tip.step(accepted_.tip_pose.position, goal_rotation_);
      paths_.rest.step(goal_);
    } else {
      paths_.tip.halt();
      paths_.rest.halt();
    }
  }
}

}  // namespace dashpot::controller
