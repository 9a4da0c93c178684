#pragma once
#include <dashpot/controller/impedance.hpp>
#include <dashpot/controller/small_cholesky.hpp>

#include <algorithm>

namespace dashpot::controller {

/// The motions that leave the held directions of the tip alone, and the tip's inertia in these
/// directions.
///
/// In energy coordinates y = L' qd (M = L L', so |y|^2 / 2 is the kinetic energy) the tip moves by
/// Jh y, Jh = J L^-T. With H (6 x 6) the held directions, their null space has the projector
///     P = I - Jh' H G^-1 H Jh,        G = H Jh Jh' H + (I - H^2) D + l D,
/// and N = L^-T P L' projects joint velocities, N' joint torques. H is a projector, or on its way
/// between two while gains change: then directions are held in part, which the second term of G
/// makes smooth. D weighs metres against radians: per block the mean of the diagonal of Jh Jh'.
///
/// Away from singularities l = 0: then P is orthogonal, N is the dynamically consistent
/// I - M^-1 J' (J M^-1 J')^-1 J, and a torque N' t does not accelerate the held directions:
/// H J M^-1 N' t = 0. No inverse blows up near a singularity: with w = 1 / trace(D G^-1), which is
/// between 1/6 and 1 times the smallest eigenvalue of G relative to D,
///     l = w_0 (1 - w / w_0)^2  for w < w_0,
/// and whatever l is, the eigenvalues of P are within [0, 1]. So for any stiffness k and deflection
/// dq the torque N' k N dq is at most  cond(M) max(k) |dq|.
template <int N>
class NullSpace {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;

  /// w_0: the arm counts as nearly singular from here on.
  static constexpr double kNearlySingular = 1e-3;

  void compute(const Square& M, const Eigen::Matrix<double, 6, N>& J,
               const typename Impedance<N>::Tip& base, const typename Impedance<N>::Tip& tool,
               const Eigen::Matrix3d& R_BT) noexcept;

  /// N' (k o N dq): torque of springs k (n) for the deflection dq, within the free motions; for
  /// dampers k and the velocity dq likewise.
  Vector torque(const Vector& k, const Vector& dq) const noexcept {
    Vector y = projected_velocity(dq).cwiseProduct(k);
    mass_.solve_L(y);
    project(y);
    mass_.multiply_L(y);
    return y;
  }
  /// N dq
  Vector projected_velocity(Vector dq) const noexcept {
    mass_.multiply_LT(dq);
    project(dq);
    mass_.solve_LT(dq);
    return dq;
  }
  /// H G^-1 H a: wrench that gives the tip the acceleration a in the held directions. Its matrix is
  /// the inertia (J M^-1 J')^-1 where all are held.
  Vector6 wrench(const Vector6& acceleration) const noexcept {
    Vector6 f = hold(acceleration);
    inertia_.solve_L(f);
    inertia_.solve_LT(f);
    return hold(f);
  }
  /// Joint velocity of least kinetic energy with which the tip moves at `twist` in the held
  /// directions: M^-1 J' H G^-1 H V.
  Vector joint_velocity(const Vector6& twist) const noexcept {
    Vector y = Jh_.transpose() * wrench(twist);
    mass_.solve_LT(y);
    return y;
  }

  /// Smallest eigenvalue of G relative to D, within a factor of 6.
  double regularity() const noexcept { return regularity_; }
  const SmallCholesky<N>& mass() const noexcept { return mass_; }

 private:
  /// y <- P y
  void project(Vector& y) const noexcept { y -= Jh_.transpose() * wrench(Jh_ * y); }
  /// H a
  Vector6 hold(const Vector6& a) const noexcept {
    Vector6 result;
    result.head<3>().noalias() = H_linear_ * a.head<3>();
    result.tail<3>().noalias() = H_angular_ * a.tail<3>();
    return result;
  }

  SmallCholesky<N> mass_;
  Eigen::Matrix<double, 6, N> Jh_;
  Eigen::Matrix3d H_linear_, H_angular_;  ///< diagonal blocks of H, which has no others
  SmallCholesky<6> inertia_;              ///< factor of G
  double regularity_ = 1;
};

template <int N>
void NullSpace<N>::compute(const Square& M, const Eigen::Matrix<double, 6, N>& J,
                           const typename Impedance<N>::Tip& base,
                           const typename Impedance<N>::Tip& tool,
                           const Eigen::Matrix3d& R_BT) noexcept {
  mass_.compute(M, 1e-14 * M.trace());
  for (int i = 0; i < N; ++i) {
    Vector6 column = J.col(i);
    for (int k = 0; k < i; ++k) column -= mass_.L(i, k) * Jh_.col(k);
    Jh_.col(i) = mass_.per_diagonal(i) * column;
  }
  H_linear_ = base.held.template head<3>().asDiagonal();
  H_angular_ = base.held.template tail<3>().asDiagonal();
  if (!tool.none()) {
    H_linear_ += R_BT * tool.held.template head<3>().asDiagonal() * R_BT.transpose();
    H_angular_ += R_BT * tool.held.template tail<3>().asDiagonal() * R_BT.transpose();
  }
  // G, block by block
  using Eigen::Matrix3d;
  Matrix6 JJ = Matrix6::Zero();
  for (int i = 0; i < N; ++i) JJ.noalias() += Jh_.col(i) * Jh_.col(i).transpose();
  const auto mean = [](double trace) { return trace > 0 ? trace / 3 : 1.0; };
  const double D_linear = mean(JJ.template topLeftCorner<3, 3>().trace());
  const double D_angular = mean(JJ.template bottomRightCorner<3, 3>().trace());
  const Matrix3d I = Matrix3d::Identity();
  Matrix6 G;
  G.topLeftCorner<3, 3>() =
      H_linear_ * JJ.topLeftCorner<3, 3>() * H_linear_ + D_linear * (I - H_linear_ * H_linear_);
  G.bottomLeftCorner<3, 3>() = H_angular_ * JJ.bottomLeftCorner<3, 3>() * H_linear_;
  G.bottomRightCorner<3, 3>() = H_angular_ * JJ.bottomRightCorner<3, 3>() * H_angular_ +
                                D_angular * (I - H_angular_ * H_angular_);
  Vector6 D;
  D << D_linear, D_linear, D_linear, D_angular, D_angular, D_angular;
  const double least_pivot = 1e-14 * std::min(D_linear, D_angular);
  inertia_.compute(G, least_pivot);
  regularity_ = 1 / inertia_.trace_of_inverse(D);
  if (regularity_ >= kNearlySingular) return;
  const double deficit = 1 - regularity_ / kNearlySingular;
  G.diagonal() += kNearlySingular * deficit * deficit * D;
  inertia_.compute(G, least_pivot);
}

}  // namespace dashpot::controller
