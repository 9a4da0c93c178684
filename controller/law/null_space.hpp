#pragma once
#include <dashpot/analysis/borne_damping.hpp>
#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/law/task_inertia.hpp>

namespace dashpot::controller {

/// The motions that do not move the tip in its selected directions.
///
/// In energy coordinates y = L' qd (M = L L', so |y|^2 / 2 is the kinetic energy) the tip moves by
/// Jh y, Jh = J L^-T. The null space of the selected directions H has the projector
///     P = I - Jh' H G^-1 H Jh,        G as in TaskInertia,
/// and N = L^-T P L' projects joint velocities, N' joint torques.
///
/// Away from singularities P is orthogonal, N is the dynamically consistent
/// I - M^-1 J' (J M^-1 J')^-1 J, and a torque N' t does not accelerate the selected directions:
/// H J M^-1 N' t = 0. Near a singularity P fades smoothly into a projector of higher rank. P is
/// bounded everywhere: G is at least Jh Jh' in the selected directions, so the eigenvalues of P are
/// within [0, 1], and for any stiffness k and deflection dq the torque N' k N dq is at most
///     cond(M) max(k) |dq|.
///
/// NullProjector::kWeighted gives springs and dampers the same with a constant diagonal W for M:
/// N = I - W^-1 J' H G^-1 H J with G of A = J W^-1 J', and a torque of at most cond(W) max(k) |dq|.
/// NullProjector::kKinematic has W = I. Where the tip stands still, N leaves the same motions free;
/// but a torque N' t accelerates the tip, because N is orthogonal in W and not in energy. All else
/// is as above: the damping for a ratio, the joint velocity of a twist, the inertia.
///
/// NullProjector::kNone has N = I: its springs and dampers act in all joints, and so on the tip as
/// well. The damping for a ratio has P = I, and, with Impedance::common_ratio, K_0 + J' K_C
/// J for K_0.
///
/// While gains change from one projector to another, J# of N = I - J# J is the mean of theirs by
/// their shares, and so are N, the P of the damping, and W^-1. A mean of generalised inverses is
/// one, so that N remains a projector on the same motions unless kNone has a share.
class NullSpace {
 public:
  /// `weights` is W of NullProjector::kWeighted (n); without entries it is I.
  explicit NullSpace(const JointVector& weights = {}) noexcept
      : per_given_(weights.cwiseInverse()) {}

  /// Computes the null space of the directions that an impedance selects, and, if it has null-space
  /// springs and a ratio for them, the damping D = 2 ratio (P L^-1 K_0 L^-T P)^1/2, n x n, 1/s, in
  /// energy coordinates: with it every free motion has the ratio on the springs K_0. Next to a
  /// singularity D fades as the root of the springs that P leaves, so that the ratio stays there as
  /// well. In a sampled loop each motion gets the share of damping with which the loop keeps its
  /// margin; springs that are active in part count with their share.
  void compute(const DynamicsResult& robot, const Impedance& impedance,
               const analysis::BorneDamping& borne = {}) noexcept;

  /// Returns N' K_0 dq with K_0 = diag(k): the torque of springs k (n) for the deflection dq.
  JointVector spring(const JointVector& k, const JointVector& dq) const noexcept;
  /// Returns N' C_0 N dqd with C_0 = diag(c): the torque of dampers c (n) for the velocity dqd.
  JointVector damper(const JointVector& c, const JointVector& dqd) const noexcept {
    return spring(c, projected_velocity(dqd));
  }
  /// Returns L D L' dqd: the torque of the damping for the ratio.
  JointVector ratio_damper(const JointVector& dqd) const noexcept;
  /// Returns D; it has no entries if there is no ratio.
  const JointMatrix& ratio_damping() const noexcept { return ratio_damping_; }
  /// Returns the share of the ratio that the loop allows.
  const analysis::DampingLevel& level() const noexcept { return level_; }
  /// Returns the part of the joints' deflection that an error e of the tip explains: J# e of the
  /// projector, N = I - J# J in the selected directions.
  JointVector explained(const Vector6& e) const noexcept;
  /// Returns N dq.
  JointVector projected_velocity(const JointVector& dq) const noexcept;
  /// Returns M^-1 N' t = N M^-1 t: the acceleration that a joint torque leaves in the null space.
  JointVector projected_acceleration(const JointVector& torque) const noexcept;
  /// Returns M^-1 J' H G^-1 H V: the joint velocity of least kinetic energy with which the tip
  /// moves at `twist` in the selected directions.
  JointVector joint_velocity(const Vector6& twist) const noexcept;
  /// Returns H G^-1 H J M^-1 t: the wrench at the tip that accelerates it as a joint torque does.
  Vector6 wrench_of(JointVector torque) const noexcept {
    mass_.solve_L(torque.data());
    return inertia_.wrench(twist(Jh_, torque));
  }
  const TaskInertia& inertia() const noexcept { return inertia_; }
  bool dynamic() const noexcept { return dynamic_ == 1; }
  double dynamic_share() const noexcept { return dynamic_; }
  double weighted_share() const noexcept { return weighted_; }  ///< kKinematic included
  double unprojected_share() const noexcept { return unprojected_; }
  /// Returns the inertia, or, of a projector with weights, what is in its place, with W for M.
  const TaskInertia& of_projector() const noexcept { return dynamic() ? inertia_ : of_weights_; }
  /// Returns W^-1 of the share of weights, n.
  const JointVector& per_weight() const noexcept { return per_weight_; }
  /// Returns L.
  const SmallCholesky& mass() const noexcept { return mass_; }
  /// Replaces y by P y, or by (1 - share) y + share P y.
  void project(JointVector& y, double share = 1) const noexcept {
    add_torque(Jh_, -share * inertia_.wrench(twist(Jh_, y)), y);
  }

 private:
  /// Returns J' H G^-1 H J dq with the G of W.
  JointVector held(const JointVector& dq) const noexcept {
    JointVector torque = JointVector::Zero(dq.size());
    add_torque(J_, of_weights_.wrench(twist(J_, dq)), torque);
    return torque;
  }
  /// Returns the damping of a free motion of a frequency, 1/s, and lowers `level` to its share of
  /// the ratio.
  struct Damping {
    const Impedance& impedance;
    const analysis::BorneDamping& borne;
    analysis::DampingLevel& level;
    double operator()(double omega) const noexcept {
      const double wanted = 2 * impedance.null_damping_ratio * omega;
      return wanted * borne.share(omega, wanted, impedance.task_share(), level);
    }
  };
  void damp(const Eigen::Matrix3d& R_BT, const Damping& damping) noexcept;
  /// Sets D if P is a projector on one motion; returns false if not.
  bool damp_one_motion(const JointVector& k, const Damping& damping) noexcept;

  double dynamic_ = 1, weighted_ = 0, unprojected_ = 0;  ///< shares of projectors
  TaskInertia inertia_;
  TaskInertia of_weights_;  ///< with W for M, as are the next two
  Jacobian J_;
  JointVector per_weight_, per_given_;  ///< W^-1, now and of NullProjector::kWeighted
  SmallCholesky mass_;
  Jacobian Jh_;
  JointMatrix ratio_damping_;
  analysis::DampingLevel level_;
};

}  // namespace dashpot::controller
