#include <dashpot/controller/law/impedance_law.hpp>

namespace dashpot::controller {
namespace {

constexpr double kReferenceFrictionRise = 0.01;  // rad/s, of a velocity that has no noise
constexpr double kFurther = 1.02;                // the reference keeps e at the edge of the clamp

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
      measured_(feed_forward.friction_at == FeedForward::FrictionAt::kMeasured),
      viscous_friction_(model.joint_values(&Joint::viscous_friction)),
      coulomb_friction_(model.joint_values(&Joint::coulomb_friction)) {
  if (measured_) {
    viscous_friction_ *= feed_forward.friction_share;
    coulomb_friction_ *= feed_forward.friction_share;
  } else {
    feed_forward_.friction_rise = kReferenceFrictionRise;
  }
}

void ImpedanceLaw::torque(const Input& now, LawTorque& result) noexcept {
  const auto& [robot, q, qd, impedance, null_space, references, clamp, wrench, integral] = now;
  JointVector& tau = result.torque;
  tau.setZero(q.size());
  JointVector reference_velocity = tau;  // qd_f
  result.dampers = tau;
  result.posture_error.resize(0);
  if (impedance.joint_weight > 0) {
    const JointReference& path = references.joint;
    add_product(impedance.joint_stiffness, difference(path.position(), q), tau);
    add_product(impedance.joint_damping, difference(path.velocity(), qd), result.dampers);
    add(path.velocity(), reference_velocity, impedance.joint_weight);
  }
  if (integral != nullptr) result.joint_pull = tau;
  if (impedance.joint_weight > 0 && feed_forward_.acceleration) {
    add_product(robot.M, references.joint.acceleration(), tau, impedance.joint_weight);
  }
  const bool task = impedance.task_weight > 0;
  Vector6& F = result.tip_wrench;
  Vector6 tip_damping;
  result.tip_pull.setZero();
  result.clamped = false;
  if (task) {
    tip_damping = pull_tip(now, result);
    if (impedance.null_space()) add_null_torque(now, result);
    if (feed_forward_.friction && !measured_) {
      add(null_space.joint_velocity(references.tip.velocity()), reference_velocity,
          impedance.task_weight);
    }
  } else {
    orientation_.reset();
    result.tip_error.setZero();
    F.setZero();
  }
  if (feed_forward_.wrench) F += wrench;
  if (integral != nullptr) {
    F += integral->wrench();
    add(integral->torque(), tau);
  }
  add_torque(robot.J, F, tau);
  add(result.dampers, tau);
  if (task) add_torque(robot.J, tip_damping, result.dampers);
  const JointVector& v = measured_ ? qd : reference_velocity;
  for (Eigen::Index i = 0; i < tau.size() && feed_forward_.friction; ++i) {
    tau[i] += viscous_friction_[i] * v[i] +
              coulomb_friction_[i] * std::tanh(v[i] / feed_forward_.friction_rise);
  }
  if (feed_forward_.coriolis) add(robot.coriolis, tau);
  if (feed_forward_.gravity) add(robot.gravity, tau);
}

Vector6 ImpedanceLaw::pull_tip(const Input& now, LawTorque& result) noexcept {
  const TipImpedance &base = now.impedance.base, &tool = now.impedance.tool;
  const Eigen::Matrix3d& R_BT = now.robot.R_BT;
  const TipReference& path = now.references.tip;
  Vector6& e = result.tip_error;
  e.head<3>() = path.position() - now.robot.p_BT_B;
  e.tail<3>() = orientation_.update(path.rotation(), Eigen::Quaterniond(R_BT));
  const Vector6 clamped = now.clamp.clamped(e, base, tool, R_BT);
  if (now.integral != nullptr) {
    const Vector6 further = kFurther * e;
    result.clamped = now.clamp.clamped(further, base, tool, R_BT) != further;
  }
  const Vector6 velocity_error = path.velocity() - twist(now.robot.J, now.qd);
  Vector6 damping = Vector6::Zero();
  if (!base.none()) {
    result.tip_pull = base.stiffness * clamped;
    damping += base.damping * velocity_error;
  }
  if (!tool.none()) {
    result.tip_pull += in_tool_axes(tool.stiffness, R_BT, clamped);
    damping += in_tool_axes(tool.damping, R_BT, velocity_error);
  }
  result.tip_wrench = result.tip_pull + damping;
  if (feed_forward_.acceleration) {
    result.tip_wrench +=
        now.impedance.task_weight * now.null_space.inertia().wrench(path.acceleration());
  }
  return damping;
}

void ImpedanceLaw::add_null_torque(const Input& now, LawTorque& result) noexcept {
  const Impedance& impedance = now.impedance;
  const NullSpace& null_space = now.null_space;
  const JointReference& posture = now.references.posture;
  JointVector& dq = result.posture_error;
  dq = difference(posture.position(), now.q);
  const JointVector share = null_space.explained(result.tip_error);
  add(share, dq, -1 / std::sqrt(1 + product(share, share) / (kPostureShare * kPostureShare)));
  JointVector dqd = difference(posture.velocity(), now.qd);
  add(null_space.spring(impedance.null_stiffness, dq), result.torque);
  add(null_space.damper(impedance.null_damping, dqd), result.dampers);
  if (impedance.common_ratio > 0) {
    const Vector6 left = now.references.tip.velocity() - twist(now.robot.J, posture.velocity());
    add(null_space.joint_velocity(left), dqd, impedance.common_ratio);
  }
  if (impedance.null_damping_ratio > 0) add(null_space.ratio_damper(dqd), result.dampers);
}

}  // namespace dashpot::controller
