#pragma once
#include <dashpot/analysis/damping_hold.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/gain_path.hpp>

namespace dashpot::controller {

/// The damping C_C with which every mode of the task stiffness K_C has one damping ratio, for a
/// mass M (n x n) and Jacobian J (6 x n) that come anew at every tick; see analysis::DampingHold.
///
/// Always symmetric, positive semidefinite to rounding, and bounded: the joint damping J' C_C J is
/// at most 2 ratio omega M for the fastest mode, and next to a singularity C_C itself at most
/// 2.3 ratio |K_C| / kSoftFrequency. Modes below kSoftFrequency get less than their ratio. Should
/// there be no design (a mass or stiffness matrix that is none), the last one stays; the first is
/// zero.
class TaskDamper {
 public:
  static constexpr double kSoftFrequency = 0.1;  ///< rad/s

  /// Forgets the last design.
  void reset() noexcept { C_C_.setZero(); }
  /// The rounding error of a semidefinite K_C may make it slightly indefinite.
  void set(const Matrix6& K_C, double ratio) noexcept;
  /// `M`, of which the lower triangle is read, is made positive definite where rounding prevents
  /// it.
  void update(analysis::Square<kMaxJoints>& M,
              const analysis::TaskJacobian<kMaxJoints>& J) noexcept;
  /// C_C in the axes of K_C and J.
  const Matrix6& damping() const noexcept { return C_C_; }

 private:
  analysis::DampingHold hold_;
  Matrix6 C_C_ = Matrix6::Zero();
};

/// Springs and dampers in force: those of the gain path, and, as far as they have a damping ratio,
/// the C_C that gives it to the tip's springs where the robot is. Ratio and stiffness are those of
/// the path, so that C_C changes as smoothly as they do. Damping in the joints and in the null
/// space comes on top.
template <int N>
class HeldDamping {
 public:
  /// Of this tick; valid until the next one.
  const Impedance<N>& update(const GainPath<N>& gains, const Dynamics<N>& robot) noexcept {
    const Impedance<N>& given = gains.now();
    const bool held = given.damping_ratio > 0 && given.task_weight > 0;
    if (held && (!held_ || gains.changes() != changes_)) {
      in_force_ = given;
      if (!held_) damper_.reset();
      set_stiffness(given, robot);
    }
    held_ = held;
    changes_ = gains.changes();
    if (held_) design(given, robot);
    return now(given);
  }
  /// The same again; `given` is that of the gain path.
  const Impedance<N>& now(const Impedance<N>& given) const noexcept {
    return held_ ? in_force_ : given;
  }
  void reset() noexcept { held_ = false; }

 private:
  /// Only while gains change, and so K_C is anew at every tick anyway.
  static bool two_frames(const Impedance<N>& given) noexcept {
    return !given.base.none() && !given.tool.none();
  }
  /// Springs in the tool's axes alone keep them: their matrix then does not change as it turns.
  static bool in_tool(const Impedance<N>& given) noexcept { return given.base.none(); }

  void set_stiffness(const Impedance<N>& given, const Dynamics<N>& robot) noexcept {
    const Matrix6& K_T = given.tool.stiffness;
    damper_.set(in_tool(given)      ? K_T
                : two_frames(given) ? Matrix6(given.base.stiffness + turned(K_T, robot.R_BT))
                                    : given.base.stiffness,
                given.damping_ratio);
  }

  void design(const Impedance<N>& given, const Dynamics<N>& robot) noexcept {
    M_.resize(N, N);
    J_.resize(6, N);
    for (int i = 0; i < N * N; ++i) M_.data()[i] = robot.M.data()[i];
    for (int j = 0; j < N; ++j) {
      const Vector6 twist = column<N>(robot.J, j);
      for (int i = 0; i < 6; ++i) J_(i, j) = twist[i];
      if (!in_tool(given)) continue;
      const Eigen::Vector3d linear = robot.R_BT.transpose() * twist.head<3>();
      const Eigen::Vector3d angular = robot.R_BT.transpose() * twist.tail<3>();
      for (int i = 0; i < 3; ++i) J_(i, j) = linear[i], J_(i + 3, j) = angular[i];
    }
    damper_.update(M_, J_);
    if (in_tool(given)) {
      in_force_.tool.damping = given.tool.damping + damper_.damping();
    } else {
      in_force_.base.damping = given.base.damping + damper_.damping();
    }
  }

  bool held_ = false;
  std::uint64_t changes_ = 0;
  Impedance<N> in_force_;
  TaskDamper damper_;
  analysis::Square<kMaxJoints> M_;
  analysis::TaskJacobian<kMaxJoints> J_;
};

}  // namespace dashpot::controller
