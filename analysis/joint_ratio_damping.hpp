#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/status.hpp>
#include <dashpot/analysis/types.hpp>

namespace dashpot::analysis {

/// Computes the damping matrix C with which every mode of springs in the joints keeps its target
/// ratio, in the control loop. For mass M, joint stiffness K = H H' and viscous friction
/// D = diag(d) (n x n each, n up to 16),  M q'' + (C + D) q' + K q = 0  has the damping ratios of
/// the target.
///
/// With M = L L' and the singular value decomposition H' L^-T = U diag(omega) V',
///     C = H U R U' H',    R as in modal_damping.hpp.
/// For one zeta, without friction, C = 2 zeta (M # K), the geometric mean. C is exact if friction
/// alone damps no direction more than is wanted, and K has full rank. Where friction does, C is a
/// PSD matrix near the exact one, and `overdone` says so.
///
/// The singular values are found by one-sided Jacobi rotations, which start from the rotations of
/// the last update. C is symmetric and positive semidefinite to rounding. Nothing here allocates or
/// throws, and the work is bounded.
class JointRatioDamping {
 public:
  using Matrix = Square<kMaxDof>;  ///< n x n

  void set_target(const DampingTarget& target) noexcept { target_ = target; }
  /// Sets d, n, N m s/rad, not negative; without entries: none.
  void set_friction(const Vector<kMaxDof>& friction) noexcept { friction_ = friction; }
  /// Factors K, of which the lower triangle is read. On kStiffnessIndefinite or kNotFinite the
  /// previous stiffness stays.
  Status set_stiffness(const Matrix& K) noexcept;

  /// Computes C for the present M, of which the lower triangle is read. On any status but kOk `C`
  /// keeps its value. kNotConverged cannot be excluded, but was never seen.
  Status update(const Matrix& M, Matrix& C) noexcept;

  /// True if friction was too much for the target at the last good update.
  bool overdone() const noexcept { return overdone_; }

 private:
  DampingTarget target_;
  Vector<kMaxDof> friction_;
  Matrix factor_;    // H
  Matrix rotated_;   // H U of the last update
  int updates_ = 0;  // since rotated_ was H
  bool overdone_ = false;
};

}  // namespace dashpot::analysis
