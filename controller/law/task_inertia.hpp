#pragma once
#include <dashpot/controller/base/impedance.hpp>
#include <dashpot/controller/base/small_cholesky.hpp>

namespace dashpot::controller {

/// Inertia of the tip in the selected directions.
///
/// From A = J M^-1 J' (6 x 6) and H (6 x 6), the selected directions, it computes
///     G = H A H + (I - H^2) D + l D.
/// H is a projector, or a blend of two while gains change. Directions are then selected in part,
/// which the second term makes smooth. D weighs metres against radians: in each block it is the
/// mean of A's diagonal. H G^-1 H is the inertia (J M^-1 J')^-1 in the selected directions.
///
/// l is zero unless the arm is nearly singular, so that G^-1 is exact elsewhere and stays bounded
/// near a singularity. With w = 1 / trace(D G^-1) for l = 0, which is between 1/6 and 1 times the
/// smallest eigenvalue of G relative to D,
///     l = w_0 (1 - w / w_0)^2  for w < w_0.
class TaskInertia {
 public:
  /// w_0
  static constexpr double kNearlySingular = 1e-3;

  /// Computes the inertia; `A` is J M^-1 J' in B's axes.
  void compute(const Matrix6& A, const TipImpedance& base, const TipImpedance& tool,
               const Eigen::Matrix3d& R_BT) noexcept;

  /// Returns H G^-1 H a: the wrench that gives the tip the acceleration a in the selected
  /// directions.
  Vector6 wrench(const Vector6& acceleration) const noexcept { return inertia_ * acceleration; }
  /// Returns w.
  double regularity() const noexcept { return regularity_; }
  /// Returns true if l > 0.
  bool nearly_singular() const noexcept { return !(regularity_ >= kNearlySingular); }
  /// Returns what a change dA of A, in the axes of the selected directions, changes H G^-1 H by
  /// through D and l alone, negated: H G^-1 dE G^-1 H with E = (I - H^2) D + l D. Only where the
  /// arm is nearly singular; elsewhere a projector H makes it zero.
  Matrix6 spread(const Matrix6& dA) const noexcept;

 private:
  Matrix6 inertia_ = Matrix6::Zero();  ///< H G^-1 H
  double regularity_ = 1;
  SmallCholesky factor_;  ///< of G
  // Where the arm is nearly singular:
  Matrix6 H_, regular_, selected_;  ///< H, G^-1 with l = 0, G^-1 H
  Vector6 D_;
};

}  // namespace dashpot::controller
