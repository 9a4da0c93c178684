#pragma once
#include <dashpot/analysis/system.hpp>

namespace dashpot::analysis {

/// The motions that store no potential energy (rigid-body modes; zero-potential modes of a
/// redundant arm, paper Eqs. 2-4), and coordinates that separate all other motions from them.
///
/// With M = L L' and an orthogonal P = [P1 P0] (n x n), q = L^-T P p. In the coordinates p the mass
/// is the identity, and the last r coordinates are the zero modes. For a symmetric stiffness P
/// holds its eigenvectors, so that the first n - r coordinates are the undamped modes.
template <int N = kDynamic>
struct ZeroModes {
  int count = 0;               ///< r
  Square<N> basis;             ///< U0, n x r, M-orthonormal: U0' M U0 = I, K U0 = 0
  Square<N> coordinates;       ///< L^-T P, n x n: q = coordinates p
  Vector<N> stiffness_values;  ///< n, rad^2/s^2, by falling magnitude, the last r zero: squares of
                               ///< the undamped frequencies, negative where K pushes away

  /// Safety of the rank decision: undamped frequencies (rad/s) next to the numerical floor.
  double floor = 0;            ///< below it a frequency is zero to rounding
  double smallest_kept = 0;    ///< smallest undamped frequency of a nonzero mode; infinite if none
  double largest_dropped = 0;  ///< largest frequency taken for zero; zero if none
};

/// Decides the rank and computes coordinates for a system whose mass has the lower Cholesky factor
/// `L`.
///
/// With a stiffness factor W the frequencies are the singular values of W L^-T, and the floor is
/// max(rows, n) eps times the largest frequency. From K alone the frequencies are roots of
/// eigenvalues, and the floor is the root of n eps times the largest frequency. If the smallest
/// frequency is that small, a positive semidefinite K is factored first, with its rank decided on K
/// scaled to a unit diagonal, so that neither graded masses nor graded stiffnesses hide a mode. The
/// zero modes of a symmetric K are then refined with residuals in double-double arithmetic, unless
/// there is a factor without low words, because K is only rounded then.
template <int N>
ZeroModes<N> find_zero_modes(const System<N>& system, const Square<N>& L) noexcept;

}  // namespace dashpot::analysis
