#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/analysis/system/zero_modes.hpp>

#include <vector>

namespace dashpot::analysis {

/// Elimination of zero modes as in the paper: each step eliminates one coordinate q_i through the
/// constraint u0' M q = 0 (Eqs. 8-13), so that q = S0 S1 ... q' (Eq. 60).
///
/// It serves reports and comparison with the paper. The spectrum itself is computed in
/// M-orthonormal coordinates (see ZeroModes), because dividing by s_i = (M u0)_i can be badly
/// conditioned.
struct RigidBodyElimination {
  std::vector<Eigen::MatrixXd> steps;  ///< S0, S1, ...: (n-k) x (n-k-1)
  std::vector<int> eliminated;         ///< index of the coordinate of q that each step eliminates
  Eigen::MatrixXd constraint_matrix;   ///< S = S0 S1 ..., n x (n-r); identity if r = 0
  Eigen::MatrixXd mass;                ///< M' = S' M S, (n-r) x (n-r); likewise C', K' (Eq. 14)
  Eigen::MatrixXd damping;
  Eigen::MatrixXd stiffness;
};

/// The coordinate that a step eliminates.
enum class Pivot {
  kLargest,  ///< the coordinate with the largest |s_i|: best conditioned
  kLast,     ///< the last remaining coordinate, as in the paper's printed examples
};

/// Eliminates the zero modes one after the other. Each is carried along into the reduced
/// coordinates with the consistent pseudo-inverse S* = (S' M S)^-1 S' M (paper, Eq. 61,
/// "Abbreviated elimination"), so that the zero modes are found once, and as exactly as in
/// `zero_modes`. The paper's "Successive elimination", which finds each again from the reduced
/// stiffness, gives the same S.
///
/// S depends on the zero modes together and on the coordinates eliminated. S0, S1, ... also depend
/// on the order of the columns of zero_modes.basis: step k eliminates the k-th column, freed from
/// the columns before it. Of the zero modes only count and basis are read. The columns need not be
/// M-orthonormal. The stiffness has to be symmetric, or no force of it may act along a zero mode.
///
/// Throws std::invalid_argument if the basis does not fit the system, and std::domain_error if
/// Pivot::kLast meets a coordinate that the zero mode does not move (s_i = 0 to rounding).
RigidBodyElimination eliminate_zero_modes(const System<>& system, const ZeroModes<>& zero_modes,
                                          Pivot pivot = Pivot::kLargest);

}  // namespace dashpot::analysis
