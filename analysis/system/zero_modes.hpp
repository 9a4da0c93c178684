#pragma once
#include <dashpot/analysis/system.hpp>

namespace dashpot::analysis {

/// The motions that store no potential energy (rigid-body modes; zero-potential modes of a
/// redundant arm, paper Eqs. 2-4), and coordinates in which all other motions are told apart from
/// them.
///
/// With M = L L' and an orthogonal P = [P1 P0] (n x n), q = L^-T P p. In these coordinates p the
/// mass is the identity and the last r of them are the zero modes. For a symmetric stiffness P
/// holds its eigenvectors, so that the first n - r coordinates are the undamped modes.
template <int N = kDynamic>
struct ZeroModes {
  int count = 0;               ///< r
  Square<N> basis;             ///< U0, n x r, M-orthonormal: U0' M U0 = I, K U0 = 0
  Square<N> coordinates;       ///< L^-T P, n x n: q = coordinates p
  Vector<N> stiffness_values;  ///< n, rad^2/s^2, by falling magnitude, the last r zero: squares of
                               ///< the undamped frequencies, negative where K pushes away

  /// How safe the decision was: undamped frequencies (rad/s) next to the numerical floor.
  double floor = 0;            ///< below it a frequency cannot be told from zero
  double smallest_kept = 0;    ///< smallest undamped frequency of a nonzero mode; infinite if none
  double largest_dropped = 0;  ///< largest frequency taken for zero; zero if none
};

/// Rank decision and coordinates for a system whose mass has the lower Cholesky factor `L`.
///
/// With a stiffness factor W the frequencies are the singular values of W L^-T, and the floor is
/// max(rows, n) eps times the largest. From K alone the frequencies are roots of eigenvalues and
/// the floor is the root of n eps times the largest, unless the smallest one is that close: then a
/// positive semidefinite K is factored first, with its rank decided on K scaled to a unit diagonal,
/// so that neither graded masses nor graded stiffnesses hide a mode. The zero modes of a symmetric
/// K are then polished with residuals in double-double arithmetic, to the accuracy a factor gives.
template <int N>
ZeroModes<N> find_zero_modes(const System<N>& system, const Square<N>& L) noexcept;

}  // namespace dashpot::analysis
