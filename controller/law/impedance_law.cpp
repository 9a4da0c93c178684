#include <dashpot/controller/law/impedance_law.hpp>

namespace dashpot::controller {
namespace {

/// Returns R K_T R' a: K_T in the tool's axes times a vector in B's axes.
Vector6 in_tool_axes(const Matrix6& K_T, const Eigen::Matrix3d& R, const Vector6& a) noexcept {
  Vector6 local, result;
  local.head<3>() = R.transpose() * a.head<3>();
  local.tail<3>() = R.transpose() * a.tail<3>();
  local = K_T * local;
  result.head<3>() = R * local.head<3>();
  result.tail<3>() = R * local.tail<3>();
  return result;
}

}  // namespace

ImpedanceLaw::ImpedanceLaw(const RobotModel& model, const FeedForward& feed_forward)
    : feed_forward_(feed_forward),
      viscous_friction_(model.joint_values(&Joint::viscous_friction)),
      coulomb_friction_(model.joint_values(&Joint::coulomb_friction)) {}

void ImpedanceLaw::torque(const DynamicsResult& robot, const JointVector& q, const JointVector& qd,
                          const Impedance& impedance, const SpringReferences& references,
                          const Vector6& wrench, const ErrorClamp& clamp,
                          JointVector& tau) noexcept {
  tau.setZero(q.size());
  JointVector reference_velocity = tau;  // qd_f
  e_.setZero();
  F_.setZero();
  if (impedance.joint_weight > 0) {
    const JointReference& path = references.joint;
    add_product(impedance.joint_stiffness, difference(path.position(), q), tau);
    add_product(impedance.joint_damping, difference(path.velocity(), qd), tau);
    if (feed_forward_.acceleration) {
      add_product(robot.M, path.acceleration(), tau, impedance.joint_weight);
    }
    add(path.velocity(), reference_velocity, impedance.joint_weight);
  }
  if (impedance.task_weight > 0) {
    const bool null_space = impedance.null_space();
    const bool moves = (references.tip.point_velocity().array() != 0).any();
    if (null_space || moves || feed_forward_.acceleration || feed_forward_.friction) {
      null_space_.compute(robot.M, robot.J, impedance.base, impedance.tool, robot.R_BT);
    }
    F_ = task_wrench(robot, qd, impedance, references.tip, clamp);
    if (null_space) {
      JointVector dq = difference(references.posture.position(), q);
      subtract_posture_share(dq);
      const JointVector dqd = difference(references.posture.velocity(), qd);
      add(null_space_.spring(impedance.null_stiffness, dq), tau);
      add(null_space_.damper(impedance.null_damping, dqd), tau);
      if (impedance.null_damping_ratio > 0) {
        const JointMatrix D =
            null_space_.ratio_damping(impedance.null_damping_ratio, impedance.null_stiffness);
        add(null_space_.damper(D, dqd), tau);
      }
    }
    if (feed_forward_.friction) {
      add(null_space_.joint_velocity(references.tip.velocity()), reference_velocity,
          impedance.task_weight);
    }
  }
  if (feed_forward_.wrench) F_ += wrench;
  add_torque(robot.J, F_, tau);
  if (feed_forward_.friction) add_friction(reference_velocity, tau);
  if (feed_forward_.coriolis) add(robot.coriolis, tau);
  if (feed_forward_.gravity) add(robot.gravity, tau);
}

Vector6 ImpedanceLaw::task_wrench(const DynamicsResult& robot, const JointVector& qd,
                                  const Impedance& impedance, const TipReference& path,
                                  const ErrorClamp& clamp) noexcept {
  e_.head<3>() = path.position() - robot.p_BT_B;
  e_.tail<3>() = orientation_.update(path.rotation(), Eigen::Quaterniond(robot.R_BT));
  const Vector6 clamped = clamp.clamped(e_, impedance.base, impedance.tool, robot.R_BT);
  const Vector6 velocity_error = path.velocity() - twist(robot.J, qd);
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

void ImpedanceLaw::subtract_posture_share(JointVector& dq) const noexcept {
  constexpr double kMost = 0.3;  // rad
  const JointVector share = null_space_.joint_velocity(e_);
  add(share, dq, -1 / std::sqrt(1 + product(share, share) / (kMost * kMost)));
}

void ImpedanceLaw::add_friction(const JointVector& velocity, JointVector& tau) const noexcept {
  constexpr double kRise = 0.01;  // rad/s; over this Coulomb friction changes sign smoothly
  for (Eigen::Index i = 0; i < tau.size(); ++i) {
    tau[i] +=
        viscous_friction_[i] * velocity[i] + coulomb_friction_[i] * std::tanh(velocity[i] / kRise);
  }
}

}  // namespace dashpot::controller
