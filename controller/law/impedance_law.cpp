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

ImpedanceLaw::ImpedanceLaw(const RobotModel& model, const FeedForward& feed_forward,
                           const SpringIntegral& integral, const analysis::BorneDamping* borne)
    : feed_forward_(feed_forward),
      friction_of_reference_(feed_forward.friction &&
                             feed_forward.friction_at == FeedForward::FrictionAt::kReference),
      friction_of_robot_(feed_forward.friction && !friction_of_reference_),
      friction_rise_(friction_of_robot_ ? feed_forward.friction_rise : 0.01),
      viscous_friction_(model.joint_values(&Joint::viscous_friction)),
      coulomb_friction_(model.joint_values(&Joint::coulomb_friction)),
      integral_(integral),
      dampers_(JointVector::Zero(model.dof())),
      joint_pull_(dampers_),
      borne_(borne) {
  if (!friction_of_robot_) return;
  viscous_friction_ *= feed_forward.friction_share;
  coulomb_friction_ *= feed_forward.friction_share;
}

void ImpedanceLaw::torque(const DynamicsResult& robot, const JointVector& q, const JointVector& qd,
                          const Impedance& impedance, const SpringReferences& references,
                          const Vector6& wrench, const ErrorClamp& clamp,
                          JointVector& tau) noexcept {
  tau.setZero(q.size());
  JointVector reference_velocity = tau;  // qd_f
  dampers_ = tau;
  e_.setZero();
  F_.setZero();
  posture_error_.resize(0);
  null_level_ = {};
  mass_known_ = false;
  if (integral_.on()) {
    clamped_ = false;
    tip_pull_.setZero();
  }
  if (impedance.joint_weight > 0) {
    const JointReference& path = references.joint;
    add_product(impedance.joint_stiffness, difference(path.position(), q), tau);
    if (integral_.on()) joint_pull_ = tau;
    add_product(impedance.joint_damping, difference(path.velocity(), qd), dampers_);
    if (feed_forward_.acceleration) {
      add_product(robot.M, path.acceleration(), tau, impedance.joint_weight);
    }
    add(path.velocity(), reference_velocity, impedance.joint_weight);
  } else if (integral_.on()) {
    joint_pull_.setZero();
  }
  if (impedance.task_weight > 0) {
    const bool null_space = impedance.null_space();
    const bool moves = (references.tip.point_velocity().array() != 0).any();
    if (null_space || moves || feed_forward_.acceleration || friction_of_reference_) {
      mass_known_ = true;
      null_space_.compute(robot.M, robot.J, impedance.base, impedance.tool, robot.R_BT);
    }
    F_ = task_wrench(robot, qd, impedance, references.tip, clamp);
    if (null_space) {
      posture_error_ = difference(references.posture.position(), q);
      subtract_posture_share(posture_error_);
      const JointVector dqd = difference(references.posture.velocity(), qd);
      add(null_space_.spring(impedance.null_stiffness, posture_error_), tau);
      add(null_space_.damper(impedance.null_damping, dqd), dampers_);
      if (impedance.null_damping_ratio > 0) {
        null_space_.set_loop(borne_, impedance.task_share());
        const JointMatrix D = null_space_.ratio_damping(impedance, null_level_);
        add(null_space_.damper(D, dqd), dampers_);
      }
    }
    if (friction_of_reference_) {
      add(null_space_.joint_velocity(references.tip.velocity()), reference_velocity,
          impedance.task_weight);
    }
  }
  if (feed_forward_.wrench) F_ += wrench;
  if (integral_.on()) {
    F_ += integral_.wrench();
    add(integral_.torque(), tau);
  }
  add_torque(robot.J, F_, tau);
  add(dampers_, tau);
  if (impedance.task_weight > 0) add_torque(robot.J, tip_damping_, dampers_);
  if (feed_forward_.friction) add_friction(friction_of_robot_ ? qd : reference_velocity, tau);
  if (feed_forward_.coriolis) add(robot.coriolis, tau);
  if (feed_forward_.gravity) add(robot.gravity, tau);
}

Vector6 ImpedanceLaw::task_wrench(const DynamicsResult& robot, const JointVector& qd,
                                  const Impedance& impedance, const TipReference& path,
                                  const ErrorClamp& clamp) noexcept {
  e_.head<3>() = path.position() - robot.p_BT_B;
  e_.tail<3>() = orientation_.update(path.rotation(), Eigen::Quaterniond(robot.R_BT));
  const Vector6 clamped = clamp.clamped(e_, impedance.base, impedance.tool, robot.R_BT);
  if (integral_.on()) {  // the reference keeps e at the edge of the clamp
    const Vector6 further = 1.02 * e_;
    clamped_ = clamp.clamped(further, impedance.base, impedance.tool, robot.R_BT) != further;
  }
  const Vector6 velocity_error = path.velocity() - twist(robot.J, qd);
  Vector6 F = Vector6::Zero();
  tip_damping_.setZero();
  if (!impedance.base.none()) {
    const Vector6 pull = impedance.base.stiffness * clamped;
    if (integral_.on()) tip_pull_ = pull;
    F += pull;
    tip_damping_ += impedance.base.damping * velocity_error;
  }
  if (!impedance.tool.none()) {
    const Vector6 pull = in_tool_axes(impedance.tool.stiffness, robot.R_BT, clamped);
    if (integral_.on()) tip_pull_ += pull;
    F += pull;
    tip_damping_ += in_tool_axes(impedance.tool.damping, robot.R_BT, velocity_error);
  }
  F += tip_damping_;
  if (feed_forward_.acceleration) {
    F += impedance.task_weight * null_space_.inertia().wrench(path.acceleration());
  }
  return F;
}

void ImpedanceLaw::subtract_posture_share(JointVector& dq) const noexcept {
  const JointVector share = null_space_.joint_velocity(e_);
  add(share, dq, -1 / std::sqrt(1 + product(share, share) / (kPostureShare * kPostureShare)));
}

void ImpedanceLaw::integrate(SpringIntegral::Change change) noexcept {
  if (clamped_ && change == SpringIntegral::Change::kFree) change = SpringIntegral::Change::kShrink;
  integral_.step(joint_pull_, tip_pull_, change);
}

void ImpedanceLaw::add_friction(const JointVector& velocity, JointVector& tau) const noexcept {
  for (Eigen::Index i = 0; i < tau.size(); ++i) {
    tau[i] += viscous_friction_[i] * velocity[i] +
              coulomb_friction_[i] * std::tanh(velocity[i] / friction_rise_);
  }
}

}  // namespace dashpot::controller
