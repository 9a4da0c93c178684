#pragma once
#include <dashpot/analysis/joint_ratio_damping.hpp>
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/gain_blend.hpp>

namespace dashpot::controller {

/// The damping C_C with which every mode of the task stiffness K_C has one damping ratio, for a
/// mass M (n x n) and Jacobian J (6 x n) that come again at every tick; see analysis::RatioDamping.
///
/// Always symmetric, positive semidefinite to rounding, and bounded: the joint damping J' C_C J is
/// at most 2 ratio omega M for the fastest mode, and next to a singularity C_C itself at most
/// 2.3 ratio |K_C| / kSoftFrequency. Modes below kSoftFrequency get less than their ratio. Should
/// there be no design (a mass or stiffness matrix that is none), the last one stays; the first is
/// zero.
class TaskDamper {
 public:
  static constexpr double kSoftFrequency = controller::kSoftFrequency;

  /// Forgets the last design.
  void reset() noexcept { C_C_.setZero(); }
  /// The rounding error of a semidefinite K_C may make it slightly indefinite. `friction` is the
  /// viscous friction of the joints (n, N m s/rad), which is taken off; none if it has no entries.
  void set(const Matrix6& K_C, double ratio, const JointVector& friction) noexcept;
  /// `M`, of which the lower triangle is read, is made positive definite where rounding prevents
  /// it.
  void update(analysis::Square<kMaxJoints>& M,
              const analysis::TaskJacobian<kMaxJoints>& J) noexcept;
  /// C_C in the axes of K_C and J.
  const Matrix6& damping() const noexcept { return C_C_; }

 private:
  analysis::RatioDamping hold_;
  Matrix6 C_C_ = Matrix6::Zero();
};

/// The damping C_q with which every mode of the joint springs K_q has one damping ratio; the rest
/// is as for TaskDamper. See analysis::JointRatioDamping.
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

/// Springs and dampers in force: those of the gain path, and, as far as they have a damping ratio,
/// the C_C and C_q that give it to the springs of tip and joints where the robot is. Ratio and
/// stiffness are those of the path, so that the damping changes as smoothly as they do. What the
/// viscous friction given damps already is taken off; of two modes in force, each takes off its
/// share. Damping in the null space comes on top.
template <int N>
class DesignedDamping {
 public:
  /// `viscous_friction`: of the robot, n, N m s/rad.
  explicit DesignedDamping(const Joints<N>& viscous_friction) noexcept
      : friction_(viscous_friction) {
    for (int i = 0; i < N; ++i) rubs_ |= viscous_friction[i] > 0;
  }

  /// Of this tick; valid until the next one.
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
  /// The same again; `given` is that of the gain path.
  const Impedance<N>& now(const Impedance<N>& given) const noexcept {
    return tip_ || joints_ ? in_force_ : given;
  }
  void reset() noexcept { tip_ = joints_ = false; }

 private:
  /// Only while gains change, and so K_C is new at every tick anyway.
  static bool two_frames(const Impedance<N>& given) noexcept {
    return !given.base.none() && !given.tool.none();
  }
  /// Springs in the tool's axes alone keep them: their matrix then does not change as it turns.
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
    if (tip_) read_mass(robot);  // of which the tip's design may have changed rounding
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
  bool rubs_ = false;                  ///< whether there is any
  bool tip_ = false, joints_ = false;  ///< whose damping is designed
  std::uint64_t changes_ = 0;
  Impedance<N> in_force_;
  TaskDamper tip_damper_;
  JointDamper joint_damper_;
  analysis::Square<kMaxJoints> M_;
  analysis::TaskJacobian<kMaxJoints> J_;
};

}  // namespace dashpot::controller
