#pragma once
#include <dashpot/analysis/borne_damping.hpp>
#include <dashpot/controller/base/joint_algebra.hpp>
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
class NullSpace {
 public:
  /// Sets what the loop bears of ratio_damping, which has to outlive this; null: any damping. Of
  /// springs that are in force in part it takes their share, above 0 and at most 1.
  void set_loop(const analysis::BorneDamping* borne, double in_force) noexcept {
    borne_ = borne;
    in_force_ = in_force;
  }
  void compute(const JointMatrix& M, const Jacobian& J, const TipImpedance& base,
               const TipImpedance& tool, const Eigen::Matrix3d& R_BT) noexcept;

  /// Returns N' K_0 dq with K_0 = diag(k): the torque of springs k (n) for the deflection dq.
  JointVector spring(const JointVector& k, const JointVector& dq) const noexcept;
  /// Returns N' C_0 N dqd with C_0 = diag(c): the torque of dampers c (n) for the velocity dqd.
  JointVector damper(const JointVector& c, const JointVector& dqd) const noexcept {
    return spring(c, projected_velocity(dqd));
  }
  /// Returns D = 2 ratio (P L^-1 K_0 L^-T P)^1/2, n x n, 1/s, symmetric, positive semidefinite: the
  /// damping in energy coordinates with which every free motion has the impedance's ratio on its
  /// null-space springs K_0. Next to a singularity it fades as the root of what P leaves of the
  /// springs, so that there the ratio stays as well. In a sampled loop each motion gets the share
  /// that the loop bears, and `level` counts it.
  JointMatrix ratio_damping(const Impedance& impedance,
                            analysis::DampingLevel& level) const noexcept;
  /// Returns L D L' dqd: the torque of dampers D in energy coordinates for the velocity dqd.
  JointVector damper(const JointMatrix& D, const JointVector& dqd) const noexcept;
  /// Returns N dq.
  JointVector projected_velocity(const JointVector& dq) const noexcept;
  /// Returns M^-1 N' t = N M^-1 t: the acceleration that a joint torque leaves in the null space.
  JointVector projected_acceleration(const JointVector& torque) const noexcept;
  /// Returns M^-1 J' H G^-1 H V: the joint velocity of least kinetic energy with which the tip
  /// moves at `twist` in the selected directions.
  JointVector joint_velocity(const Vector6& twist) const noexcept;
  const TaskInertia& inertia() const noexcept { return inertia_; }
  /// Returns L.
  const SmallCholesky& mass() const noexcept { return mass_; }
  /// Replaces y by P y.
  void project(JointVector& y) const noexcept {
    add_torque(Jh_, -inertia_.wrench(twist(Jh_, y)), y);
  }

 private:
  /// Sets D of ratio_damping if P is a projector on one motion; returns false if not.
  bool damp_one_motion(const Impedance& impedance, analysis::DampingLevel& level,
                       JointMatrix& D) const noexcept;
  /// Returns the damping of a free motion of this frequency, 1/s.
  double damping(const Impedance& impedance, double omega,
                 analysis::DampingLevel& level) const noexcept;

  TaskInertia inertia_;
  SmallCholesky mass_;
  Jacobian Jh_;
  const analysis::BorneDamping* borne_ = nullptr;
  double in_force_ = 1;
};

}  // namespace dashpot::controller
