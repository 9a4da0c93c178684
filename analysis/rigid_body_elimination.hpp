#pragma once
#include <dashpot/analysis/system.hpp>
#include <dashpot/analysis/system/zero_modes.hpp>

#include <vector>

namespace dashpot::analysis {

/// RigidBodyElimination of zero modes as the paper has it: each elimination eliminates one
/// coordinate q_i through the constraint u0' M q = 0 (Eqs. 8-13), so that q = S0 S1 ... q' (Eq.
/// 60).
///
/// This is for reporting and for reading beside the paper: dividing by s_i = (M u0)_i can be badly
/// conditioned, so the spectrum itself is computed in M-orthonormal coordinates (see ZeroModes).
struct RigidBodyElimination {
  std::vector<Eigen::MatrixXd> steps;  ///< S0, S1, ...: (n-k) x (n-k-1)
  std::vector<int> eliminated;         ///< index of the coordinate of q that each step eliminates
  Eigen::MatrixXd constraint_matrix;   ///< S = S0 S1 ..., n x (n-r); identity if r = 0
  Eigen::MatrixXd mass;                ///< M' = S' M S, (n-r) x (n-r); likewise C', K' (Eq. 14)
  Eigen::MatrixXd damping;
  Eigen::MatrixXd stiffness;
};

/// Which coordinate a elimination eliminates.
enum class Pivot {
  kLargest,  ///< the one with the largest |s_i|: best conditioned
  kLast,     ///< the last one left, as the paper's printed examples do
};

// Both methods give the same S, which depends on the zero modes together and on the coordinates
// eliminated. S0, S1, ... also depend on the order of the columns of zero_modes.basis: step k
// removes the k-th column, freed from those before it. Of the zero modes only count and basis are
// read; the columns need not be M-orthonormal. The stiffness has to be symmetric.
//
// Both throw std::invalid_argument if the basis does not fit the system, and std::domain_error if
// Pivot::kLast meets a coordinate that the zero mode does not move (s_i = 0 to rounding).

/// Removes one zero mode after the other, finding each again as a null vector of the current
/// reduced stiffness (paper, "Successive elimination"). While that has several, the one nearest to
/// the next column of the basis is taken.
RigidBodyElimination eliminate_successively(const System<>& system, const ZeroModes<>& zero_modes,
                                            Pivot pivot = Pivot::kLargest);

/// Removes all zero modes from the one basis, carrying each along with the consistent
/// pseudo-inverse S* = (S' M S)^-1 S' M (paper, Eq. 61, "Abbreviated elimination").
RigidBodyElimination eliminate_abbreviated(const System<>& system, const ZeroModes<>& zero_modes,
                                           Pivot pivot = Pivot::kLargest);

}  // namespace dashpot::analysis
