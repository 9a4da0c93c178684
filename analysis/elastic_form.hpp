#pragma once
#include <dashpot/analysis/solver_status.hpp>
#include <dashpot/analysis/system.hpp>

namespace dashpot::analysis {

/// A system with a stiffness factor W in mass-normalised coordinates p that separate the springs
/// from the zero modes, q = coordinates p:
///
///     p'' + D p' + [R R' 0; 0 0] p = 0.
///
/// With M = L L' and L^-1 W' = Q [R; 0], the coordinates are L^-T Q. If W has more rows than
/// columns, W L^-T = Q R' replaces this, and there are no zero modes. The form needs no
/// eigenvectors, so that it is much cheaper than ZeroModes.
template <int N = kDynamic>
struct ElasticForm {
  Square<N> coordinates;  ///< n x n
  Square<N> root;         ///< R, m x m
  Square<N> damping;      ///< D, n x n, 1/s
  /// Lower bound of the smallest singular value of R, the smallest undamped frequency of the m
  /// modes, at least 1/sqrt(m) of it; rad/s. Zero if W has not full rank, infinite if m = 0.
  double slowest = 0;
  /// True if D leaves the n - m zero modes alone to rounding. Their velocities then stay constant.
  bool free_zero_modes = true;

  Eigen::Index modes() const { return root.rows(); }
};

/// Computes the elastic form of a symmetric system with a stiffness factor. Only mass, damping and
/// stiffness_factor are read, and of the mass the lower triangle. The status is kOk,
/// kMassNotPositiveDefinite, or kNotFinite. Allocates nothing for a fixed N.
template <int N>
Status to_elastic_form(const System<N>& system, ElasticForm<N>& out) noexcept;

/// Computes the eigenvalues alone, without vectors and without proved bounds: 2 m of the modes, and
/// n - m of the zero modes' velocities unless these are free. The errors are about eps times the
/// largest eigenvalue. The status is kOk or kNotConverged. Allocates nothing for a fixed N.
template <int N>
Status elastic_eigenvalues(
    const ElasticForm<N>& form,
    Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1>& out) noexcept;

}  // namespace dashpot::analysis
