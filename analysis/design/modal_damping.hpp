#pragma once
#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/status.hpp>
#include <dashpot/analysis/types.hpp>

namespace dashpot::analysis {

/// The damping that is missing, in modal coordinates, at up to 16 modes: with the damping G that is
/// there (k x k, mass-normalised modal coordinates: V' L^-1 D L^-T V) and the frequencies omega
/// (k),
///     R = S [T]+ S,    S = diag(1 / omega),    T = diag(2 zeta omega) - G,
/// where [T]+ is the PSD matrix nearest to T in the Frobenius norm: T itself if it is semidefinite.
/// Soft modes have a smaller S, so that G = 0 gives R = diag(target.damper(omega)).
///
/// If some G_ii is above 2 zeta omega_i, T is not semidefinite, and the couplings G_ij of mode i
/// count by w_i w_j only, w = 1 - (1 - 2 zeta omega_i / G_ii)^3: without that R_ij would grow like
/// 1 / omega_i where it vanishes at a singularity, and with it the torque along a moving
/// set-point. With it |R_ij| omega_i <= 6 zeta sqrt(G_ii / G_jj) for a vanishing mode j.
///
/// G is read and overwritten by R. kNotConverged cannot be excluded, but was never seen. Nothing
/// allocates or throws. `overdone` says whether T had to be changed: what is there is too much.
Status missing_damping(const Vector<kMaxDof>& omega, const DampingTarget& target, double soft,
                       Square<kMaxDof>& G, bool& overdone) noexcept;

}  // namespace dashpot::analysis
