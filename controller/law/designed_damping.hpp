#pragma once
#include <dashpot/analysis/joint_ratio_damping.hpp>
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/gain_blend.hpp>

namespace dashpot::controller {

/// Designs the damping C_C with which every mode of the task stiffness K_C has one damping ratio,
/// for a mass M (n x n) and Jacobian J (6 x n) that are new at every tick; see
/// analysis::RatioDamping.
///
/// C_C is symmetric, positive semidefinite to rounding, and bounded. The joint damping J' C_C J is
/// at most 2 ratio omega M for the fastest mode, and next to a singularity C_C itself is at most
/// 2.3 ratio |K_C| / kSoftFrequency. Modes below kSoftFrequency get less than their ratio. If there
/// is no design, because a mass or stiffness matrix is not valid, the last C_C stays; the first C_C
/// is zero.
class TaskDamper {
 public:
  static constexpr double kSoftFrequency = controller::kSoftFrequency;

  /// Forgets the last design.
  void reset() noexcept { C_C_.setZero(); }
  /// Sets the stiffness, which rounding errors may make slightly indefinite, and the ratio.
  /// `friction` is the viscous friction of the joints (n, N m s/rad), which is subtracted from the
  /// damping; without entries there is none.
  void set(const Matrix6& K_C, double ratio, const JointVector& friction) noexcept;
  /// Designs C_C for this tick. Reads the lower triangle of `M`, and makes `M` positive definite
  /// if rounding errors have made it indefinite.
  void update(analysis::Square<kMaxJoints>& M,
              const analysis::TaskJacobian<kMaxJoints>& J) noexcept;
  /// Returns C_C in the axes of K_C and J.
  const Matrix6& damping() const noexcept { return C_C_; }

 private:
  analysis::RatioDamping hold_;
  Matrix6 C_C_ = Matrix6::Zero();
};

/// Designs the damping C_q with which every mode of the joint springs K_q has one damping ratio, as
/// TaskDamper does for the task. See analysis::JointRatioDamping.
class JointDamper {
 public:
  void reset(int n) noexcept { C_q_.setZero(n, n); }
  void set(const JointMatrix& K_q, double ratio, const JointVector& friction) noexcept;
  void update(JointMatrix& M) noexcept;
  const JointMatrix& damping() const noexcept { return C_q_; }

 private:
  analysis::JointRatioDamping hold_;
  JointMatrix C_q_;
};

/// Springs and dampers in force: the blended gains, and, as far as these have a damping ratio, the
/// C_C and C_q that give this ratio to the springs of tip and joints at the robot's posture. Ratio
/// and stiffness are the blended ones, so that the damping changes as smoothly as they do. The
/// given viscous friction is subtracted; if two modes are in force, each subtracts its share.
/// Damping in the null space is added.
template <int N>
class DesignedDamping {
 public:
  /// `viscous_friction` is the friction of the robot's joints, n, N m s/rad.
  explicit DesignedDamping(const Joints<N>& viscous_friction) noexcept
      : friction_(viscous_friction) {
    for (int i = 0; i < N; ++i) rubs_ |= viscous_friction[i] > 0;
  }

  /// Designs the damping of this tick. Returns springs and dampers, valid until the next tick.
  const Impedance<N>& update(const GainBlend<N>& gains, const Dynamics<N>& robot) noexcept {
    const Impedance<N>& given = gains.now();
    const bool tip = given.damping_ratio > 0 && given.task_weight > 0;
    const bool joints = given.joint_damping_ratio > 0 && given.joint_weight > 0;
    const bool changed = gains.changes() != changes_;
    if ((tip && !tip_) || (joints && !joints_) || changed) {
      if (tip || joints) in_force_ = given;
      if (!tip_) tip_damper_.reset();
      if (!joints_) joint_damper_.reset(N);
      if (tip) set_tip(given, robot);
      if (joints) set_joints(given);
    }
    tip_ = tip;
    joints_ = joints;
    changes_ = gains.changes();
    if (tip || joints) read_mass(robot);
    if (tip) design_tip(given, robot);
    if (joints) design_joints(given, robot);
    return now(given);
  }
  /// Returns springs and dampers of this tick again; `given` are the blended gains.
  const Impedance<N>& now(const Impedance<N>& given) const noexcept {
    return tip_ || joints_ ? in_force_ : given;
  }
  void reset() noexcept { tip_ = joints_ = false; }

 private:
  /// Returns true if springs in both frames are in force. They are only while gains change, so that
  /// K_C is new at every tick anyway.
  static bool two_frames(const Impedance<N>& given) noexcept {
    return !given.base.none() && !given.tool.none();
  }
  /// Returns true if all springs are in the tool's axes. C_C is then designed in these axes,
  /// because there K_C does not change as the tool turns.
  static bool in_tool(const Impedance<N>& given) noexcept { return given.base.none(); }

  JointVector friction(double share) const noexcept {
    JointVector result;
    if (rubs_) copy<N>(friction_, result);
    for (double& value : result) value *= share;
    return result;
  }

  void set_tip(const Impedance<N>& given, const Dynamics<N>& robot) noexcept {
    const Matrix6& K_T = given.tool.stiffness;
    tip_damper_.set(in_tool(given)      ? K_T
                    : two_frames(given) ? Matrix6(given.base.stiffness + turned(K_T, robot.R_BT))
                                        : given.base.stiffness,
                    given.damping_ratio, friction(given.task_weight));
  }

  void set_joints(const Impedance<N>& given) noexcept {
    JointMatrix K_q(N, N);
    for (int i = 0; i < N * N; ++i) K_q.data()[i] = given.joint_stiffness.data()[i];
    joint_damper_.set(K_q, given.joint_damping_ratio, friction(given.joint_weight));
  }

  void read_mass(const Dynamics<N>& robot) noexcept {
    M_.resize(N, N);
    for (int i = 0; i < N * N; ++i) M_.data()[i] = robot.M.data()[i];
  }

  void design_joints(const Impedance<N>& given, const Dynamics<N>& robot) noexcept {
    if (tip_) read_mass(robot);  // again, because the tip's design may have changed M_
    joint_damper_.update(M_);
    const JointMatrix& C_q = joint_damper_.damping();
    for (int i = 0; i < N * N; ++i) {
      in_force_.joint_damping.data()[i] = given.joint_damping.data()[i] + C_q.data()[i];
    }
  }

  void design_tip(const Impedance<N>& given, const Dynamics<N>& robot) noexcept {
    J_.resize(6, N);
    for (int j = 0; j < N; ++j) {
      const Vector6 twist = column<N>(robot.J, j);
      for (int i = 0; i < 6; ++i) J_(i, j) = twist[i];
      if (!in_tool(given)) continue;
      const Eigen::Vector3d linear = robot.R_BT.transpose() * twist.head<3>();
      const Eigen::Vector3d angular = robot.R_BT.transpose() * twist.tail<3>();
      for (int i = 0; i < 3; ++i) J_(i, j) = linear[i], J_(i + 3, j) = angular[i];
    }
    tip_damper_.update(M_, J_);
    if (in_tool(given)) {
      in_force_.tool.damping = given.tool.damping + tip_damper_.damping();
    } else {
      in_force_.base.damping = given.base.damping + tip_damper_.damping();
    }
  }

  Joints<N> friction_;
  bool rubs_ = false;                  ///< whether there is viscous friction
  bool tip_ = false, joints_ = false;  ///< whose damping is designed
  std::uint64_t changes_ = 0;
  Impedance<N> in_force_;
  TaskDamper tip_damper_;
  JointDamper joint_damper_;
  analysis::Square<kMaxJoints> M_;
  analysis::TaskJacobian<kMaxJoints> J_;
};

}  // namespace dashpot::controller
