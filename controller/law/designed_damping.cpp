#include <dashpot/controller/law/designed_damping.hpp>

namespace dashpot::controller {

void RatioDamper::set(const JointMatrix& K, double ratio, const JointVector& friction) noexcept {
  analysis::DampingTarget target = analysis::DampingTarget::constant(ratio);
  target.soft_frequency = kSoftFrequency;
  design_.set_target(target);
  design_.set_friction(friction);
  if (design_.set_stiffness(K) == analysis::Status::kOk) return;
  // The largest indefiniteness that check_gains accepts. It adds a slow, soft mode.
  JointMatrix raised = K;
  raised.diagonal().array() += 2e-10 * K.cwiseAbs().maxCoeff();
  design_.set_stiffness(raised);
}

void RatioDamper::update(const JointMatrix& M, const Jacobian* J) noexcept {
  definite_ = M;
  definite_.diagonal().array() += 1e-14 * M.trace();
  if (J == nullptr) {
    design_.update(definite_, C_);
  } else {
    design_.update(definite_, *J, C_);
  }
}

DesignedDamping::DesignedDamping(const JointVector& viscous_friction,
                                 const analysis::BorneDamping& borne, const JointVector& weights)
    : borne_(borne),
      joint_damper_(static_cast<int>(viscous_friction.size())),
      in_force_(static_cast<int>(viscous_friction.size())),
      null_space_(weights) {
  if ((viscous_friction.array() > 0).any()) friction_ = viscous_friction;
}

const Impedance& DesignedDamping::update(const GainBlend& gains,
                                         const DynamicsResult& robot) noexcept {
  const Impedance& given = gains.now();
  const bool tip = given.damping_ratio > 0 && given.task_weight > 0;
  const bool joints = given.joint_damping_ratio > 0 && given.joint_weight > 0;
  if ((tip && !tip_) || (joints && !joints_) || gains.changes() != changes_) {
    if (tip || joints) in_force_ = given;
    if (!tip_) tip_damper_.reset();
    if (!joints_) joint_damper_.reset();
    if (tip) set_tip(given, robot);
    if (joints) {
      joint_damper_.set_loop(borne_, 1 - given.task_share());
      joint_damper_.set(given.joint_stiffness, given.joint_damping_ratio,
                        friction(given.joint_weight));
    }
  }
  tip_ = tip;
  joints_ = joints;
  changes_ = gains.changes();
  if (tip) design_tip(given, robot);
  if (joints) {
    joint_damper_.update(robot.M, nullptr);
    in_force_.joint_damping = given.joint_damping + joint_damper_.damping();
  }
  if (given.task_weight > 0) null_space_.compute(robot, given, borne_);
  return now(given);
}

analysis::DampingLevel DesignedDamping::level(const Impedance& given) const noexcept {
  analysis::DampingLevel result;
  if (given.task_weight > 0) result = null_space_.level();
  if (tip_) result.include(tip_damper_.level());
  if (joints_) result.include(joint_damper_.level());
  return result;
}

JointVector DesignedDamping::friction(double share) const noexcept {
  JointVector result = friction_;
  for (double& value : result) value *= share;
  return result;
}

void DesignedDamping::set_tip(const Impedance& given, const DynamicsResult& robot) noexcept {
  // If all springs are in the tool's axes, C_C is designed there, because K_C does not change in
  // them as the tool turns. Springs in both frames are active only while gains change, so that K_C
  // is new at every tick.
  const Matrix6 &K_B = given.base.stiffness, &K_T = given.tool.stiffness;
  const Matrix6 K_C = given.base.none()    ? K_T
                      : !given.tool.none() ? Matrix6(K_B + turned(K_T, robot.R_BT))
                                           : K_B;
  tip_damper_.set_loop(borne_, given.task_share());
  tip_damper_.set(K_C, given.damping_ratio, friction(given.task_weight));
}

void DesignedDamping::design_tip(const Impedance& given, const DynamicsResult& robot) noexcept {
  if (!given.base.none()) {
    tip_damper_.update(robot.M, &robot.J);
    in_force_.base.damping = given.base.damping + tip_damper_.damping();
    return;
  }
  J_.resize(6, robot.J.cols());
  for (Eigen::Index j = 0; j < J_.cols(); ++j) {
    J_.col(j).head<3>() = robot.R_BT.transpose() * robot.J.col(j).head<3>();
    J_.col(j).tail<3>() = robot.R_BT.transpose() * robot.J.col(j).tail<3>();
  }
  tip_damper_.update(robot.M, &J_);
  in_force_.tool.damping = given.tool.damping + tip_damper_.damping();
}

}  // namespace dashpot::controller
