#pragma once
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/null_space.hpp>
#include <dashpot/controller/motion/reference.hpp>
#include <dashpot/controller/settings.hpp>

#include <limits>

namespace dashpot::controller {

/// References of all springs.
template <int N>
struct SpringReferences {
  JointReference<N> joint;    ///< of mode kJoint: q_d
  JointReference<N> posture;  ///< posture of a redundant arm: q_0
  TipReference tip;           ///< of mode kCartesian: p_d, R_d and twist V_d
};

/// Computes the joint torque of springs and dampers between robot and reference, and of the
/// feed-forward:
///
///     tau = K_q (q_d - q) + C_q (qd_d - qd) + w_q M qdd_d           joint impedance
///         + J' (K_C e + C_C (V_d - J qd) + w_C Lambda Vd_d + f)     Cartesian impedance, wrench
///         + N' K_0 (q_0 - q - s J# e) + N' C_0 N (qd_0 - qd)        redundancy
///         + friction(qd_f) + coriolis + gravity                     the robot
///
/// e = (p_d - p, rotation vector of R_d R'), in B's axes at the tip: linear, then angular. K_C is
/// the sum of the stiffness given in B's axes and R K_T R' for the stiffness K_T given in the
/// tool's axes, and C_C likewise. w_q and w_C are the shares of the two modes, 0 or 1 except while
/// the mode changes; K_q and C_q, K_C and C_C, K_0 and C_0 contain them. Lambda = (J M^-1 J')^-1 in
/// the selected directions (see TaskInertia); N and J# = M^-1 J' Lambda are explained in NullSpace.
/// f is the commanded wrench. qd_f = w_q qd_d + w_C (joint velocity that takes the tip along V_d),
/// and friction_i(v) = viscous_friction_i v + coulomb_friction_i tanh(v / 0.01 rad/s). J# e is the
/// part of q_0 - q that a deflection of the tip explains. It is subtracted, because otherwise
/// deflections of the tip would drive the self-motion, and the stiffness of the loop would not be
/// symmetric. It counts fully while it is small: s = 1 / sqrt(1 + (|J# e| / 0.3 rad)^2). Every term
/// of the last column can be left out, see FeedForward.
///
/// K_C acts on e within the error clamp (see ErrorClamp): a tip that is further away is pulled no
/// harder.
///
/// The torque is bounded wherever the arm is, because J', N (see NullSpace) and e are bounded. Only
/// Lambda is divided by something that vanishes at a singularity, and it is damped there.
template <int N>
class ImpedanceLaw {
 public:
  using Vector = Joints<N>;

  ImpedanceLaw(const RobotModel& model, const FeedForward& feed_forward)
      : feed_forward_(feed_forward),
        viscous_friction_(fixed<N>(model.joint_values(&Joint::viscous_friction))),
        coulomb_friction_(fixed<N>(model.joint_values(&Joint::coulomb_friction))) {}

  /// Returns the joint torque. `wrench` is f, which counts only if FeedForward::wrench is on.
  Vector torque(const Dynamics<N>& robot, const Vector& q, const Vector& qd,
                const Impedance<N>& impedance, const SpringReferences<N>& references,
                const Vector6& wrench, const ErrorClamp& clamp = kEndless) noexcept;

  /// Forgets the last orientation error: the next one is the short way round.
  void reset() noexcept { orientation_.reset(); }

  /// Return terms of the last torque: e, the wrench of its Cartesian part, and the null space,
  /// which is up to date if the impedance has null-space springs or dampers.
  const Vector6& tip_error() const noexcept { return e_; }
  const Vector6& tip_wrench() const noexcept { return F_; }
  const NullSpace<N>& null_space() const noexcept { return null_space_; }

 private:
  static constexpr ErrorClamp kEndless{std::numeric_limits<double>::infinity(),
                                       std::numeric_limits<double>::infinity()};

  /// K_C e + C_C (V_d - J qd) + w_C Lambda Vd_d
  Vector6 task_wrench(const Dynamics<N>& robot, const Vector& qd, const Impedance<N>& impedance,
                      const TipReference& path, const ErrorClamp& clamp) noexcept;
  /// s J# e
  Vector posture_share() const noexcept;
  void add_friction(const Vector& velocity, Vector& tau) const noexcept;

  FeedForward feed_forward_;
  Vector viscous_friction_;
  Vector coulomb_friction_;
  OrientationError orientation_;
  NullSpace<N> null_space_;
  Vector6 e_ = Vector6::Zero();
  Vector6 F_ = Vector6::Zero();
};

/// Returns R K_T R' a: K_T in the tool's axes times a vector in B's axes.
inline Vector6 in_tool_axes(const Matrix6& K_T, const Eigen::Matrix3d& R,
                            const Vector6& a) noexcept {
  Vector6 local, result;
  local.head<3>() = R.transpose() * a.head<3>();
  local.tail<3>() = R.transpose() * a.tail<3>();
  local = K_T * local;
  result.head<3>() = R * local.head<3>();
  result.tail<3>() = R * local.tail<3>();
  return result;
}

template <int N>
Joints<N> ImpedanceLaw<N>::torque(const Dynamics<N>& robot, const Vector& q, const Vector& qd,
                                  const Impedance<N>& impedance,
                                  const SpringReferences<N>& references, const Vector6& wrench,
                                  const ErrorClamp& clamp) noexcept {
  Vector tau = Vector::Zero();
  Vector reference_velocity = Vector::Zero();  // qd_f
  e_.setZero();
  F_.setZero();
  if (impedance.joint_weight > 0) {
    const JointReference<N>& path = references.joint;
    add_product<N>(impedance.joint_stiffness, difference<N>(path.position(), q), tau);
    add_product<N>(impedance.joint_damping, difference<N>(path.velocity(), qd), tau);
    if (feed_forward_.acceleration) {
      add_product<N>(robot.M, path.acceleration(), tau, impedance.joint_weight);
    }
    add<N>(path.velocity(), reference_velocity, impedance.joint_weight);
  }
  if (impedance.task_weight > 0) {
    const bool null_space = impedance.null_space();
    const bool moves = (references.tip.point_velocity().array() != 0).any();
    if (null_space || moves || feed_forward_.acceleration || feed_forward_.friction) {
      null_space_.compute(robot.M, robot.J, impedance.base, impedance.tool, robot.R_BT);
    }
    F_ = task_wrench(robot, qd, impedance, references.tip, clamp);
    if (null_space) {
      Vector dq = difference<N>(references.posture.position(), q);
      dq -= posture_share();
      const Vector dqd = difference<N>(references.posture.velocity(), qd);
      add<N>(null_space_.spring(impedance.null_stiffness, dq), tau);
      add<N>(null_space_.damper(impedance.null_damping, dqd), tau);
    }
    if (feed_forward_.friction) {
      add<N>(null_space_.joint_velocity(references.tip.velocity()), reference_velocity,
             impedance.task_weight);
    }
  }
  if (feed_forward_.wrench) F_ += wrench;
  add_torque<N>(robot.J, F_, tau);
  if (feed_forward_.friction) add_friction(reference_velocity, tau);
  if (feed_forward_.coriolis) add<N>(robot.coriolis, tau);
  if (feed_forward_.gravity) add<N>(robot.gravity, tau);
  return tau;
}

template <int N>
Vector6 ImpedanceLaw<N>::task_wrench(const Dynamics<N>& robot, const Vector& qd,
                                     const Impedance<N>& impedance, const TipReference& path,
                                     const ErrorClamp& clamp) noexcept {
  e_.head<3>() = path.position() - robot.p_BT_B;
  e_.tail<3>() = orientation_.update(path.rotation(), Eigen::Quaterniond(robot.R_BT));
  const Vector6 clamped = clamp.clamped(e_, impedance.base, impedance.tool, robot.R_BT);
  const Vector6 velocity_error = path.velocity() - twist<N>(robot.J, qd);
  Vector6 F = Vector6::Zero();
  if (!impedance.base.none()) {
    F += impedance.base.stiffness * clamped + impedance.base.damping * velocity_error;
  }
  if (!impedance.tool.none()) {
    F += in_tool_axes(impedance.tool.stiffness, robot.R_BT, clamped) +
         in_tool_axes(impedance.tool.damping, robot.R_BT, velocity_error);
  }
  if (feed_forward_.acceleration) {
    F += impedance.task_weight * null_space_.inertia().wrench(path.acceleration());
  }
  return F;
}

template <int N>
Joints<N> ImpedanceLaw<N>::posture_share() const noexcept {
  constexpr double kMost = 0.3;  // rad
  Vector share = null_space_.joint_velocity(e_);
  double square = 0;
  for (int i = 0; i < N; ++i) square += share[i] * share[i];
  const double scale = 1 / std::sqrt(1 + square / (kMost * kMost));
  for (int i = 0; i < N; ++i) share[i] *= scale;
  return share;
}

template <int N>
void ImpedanceLaw<N>::add_friction(const Vector& velocity, Vector& tau) const noexcept {
  constexpr double kRise = 0.01;  // rad/s; over this Coulomb friction changes sign smoothly
  for (int i = 0; i < N; ++i) {
    tau[i] +=
        viscous_friction_[i] * velocity[i] + coulomb_friction_[i] * std::tanh(velocity[i] / kRise);
  }
}

}  // namespace dashpot::controller
