#pragma once
#include <dashpot/analysis/matrix_types.hpp>
#include <dashpot/analysis/solver_status.hpp>

namespace dashpot::analysis {

/// Computes the missing damping in modal coordinates, for up to 16 modes. With the damping G given
/// already (k x k, mass-normalised modal coordinates: V' L^-1 D L^-T V), the frequencies omega (k)
/// and the damping `wanted` (k, d = 2 zeta omega) it is
///     R = S [T]+ S,    S = diag(1 / omega),    T = diag(d) - G,
/// where [T]+ is the PSD matrix nearest to T in the Frobenius norm: T itself if T is semidefinite.
/// Soft modes have a smaller S, so that G = 0 gives R = diag(DampingTarget::damper(omega)).
///
/// If some G_ii is above d_i, T is not semidefinite. The couplings G_ij of mode i then count by
/// w_i w_j only, w = 1 - (1 - d_i / G_ii)^3. Without this factor R_ij would grow like 1 / omega_i
/// where omega_i vanishes at a singularity, and so would the torque along a moving set-point. With
/// it |R_ij| omega_i <= 6 zeta sqrt(G_ii / G_jj) for a vanishing mode j.
///
/// G is read and overwritten by R. `overdone` is set to true if T had to be changed, because the
/// damping given already is too much. kNotConverged cannot be excluded, but was never seen. Nothing
/// allocates or throws.
Status missing_damping(const Vector<kMaxDof>& omega, const Vector<kMaxDof>& wanted, double soft,
                       Square<kMaxDof>& G, bool& overdone) noexcept;

}  // namespace dashpot::analysis
