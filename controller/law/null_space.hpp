#pragma once
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
template <int N>
class NullSpace {
 public:
  void compute(const JointSquare<N>& M, const Jacobian<N>& J, const TipImpedance& base,
               const TipImpedance& tool, const Eigen::Matrix3d& R_BT) noexcept;

  /// Returns N' K_0 dq with K_0 = diag(k): the torque of springs k (n) for the deflection dq.
  Joints<N> spring(const Joints<N>& k, Joints<N> dq) const noexcept {
    for (int i = 0; i < N; ++i) dq[i] *= k[i];
    mass_.solve_L(dq);
    project(dq);
    mass_.multiply_L(dq);
    return dq;
  }
  /// Returns N' C_0 N dqd with C_0 = diag(c): the torque of dampers c (n) for the velocity dqd.
  Joints<N> damper(const Joints<N>& c, const Joints<N>& dqd) const noexcept {
    return spring(c, projected_velocity(dqd));
  }
  /// Returns N dq.
  Joints<N> projected_velocity(Joints<N> dq) const noexcept {
    mass_.multiply_LT(dq);
    project(dq);
    mass_.solve_LT(dq);
    return dq;
  }
  /// Returns M^-1 J' H G^-1 H V: the joint velocity of least kinetic energy with which the tip
  /// moves at `twist` in the selected directions.
  Joints<N> joint_velocity(const Vector6& twist) const noexcept {
    Joints<N> y = Joints<N>::Zero();
    add_torque<N>(Jh_, inertia_.wrench(twist), y);
    mass_.solve_LT(y);
    return y;
  }
  const TaskInertia& inertia() const noexcept { return inertia_; }
  /// Returns L.
  const SmallCholesky<N>& mass() const noexcept { return mass_; }
  /// Replaces y by P y.
  void project(Joints<N>& y) const noexcept {
    const Vector6 f = inertia_.wrench(twist<N>(Jh_, y));
    add_torque<N>(Jh_, -f, y);
  }

 private:
  SmallCholesky<N> mass_;
  Jacobian<N> Jh_;
  TaskInertia inertia_;
};

template <int N>
void NullSpace<N>::compute(const JointSquare<N>& M, const Jacobian<N>& J, const TipImpedance& base,
                           const TipImpedance& tool, const Eigen::Matrix3d& R_BT) noexcept {
  double trace = 0;
  for (int i = 0; i < N; ++i) trace += M(i, i);
  mass_.compute(M, 1e-14 * trace);
  Matrix6 A = Matrix6::Zero();  // Jh Jh'
  for (int i = 0; i < N; ++i) {
    Vector6 y = column<N>(J, i);
    for (int k = 0; k < i; ++k) y -= mass_.L(i, k) * column<N>(Jh_, k);
    y *= mass_.per_diagonal(i);
    column<N>(Jh_, i) = y;
    for (int k = 0; k < 6; ++k) A.col(k) += y[k] * y;
  }
  inertia_.compute(A, base, tool, R_BT);
}

}  // namespace dashpot::controller
