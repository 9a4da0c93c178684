#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Sets K = W'W of the factor with about 32 digits, as stiffness and its low word, and adds what
/// these lack at most to stiffness_error.
void form_stiffness(System<kMaxDof>& system) noexcept;

/// Builds a tracked basis from the basis of a direct solution: columns (W u, u Lambda), made
/// orthonormal in the indefinite metric mode by mode, in the order of the modes of `spectrum`.
/// Where a mode lost its stiffness (a singular arm), its elastic coordinate is added, with a zero
/// mode's velocity as its partner. Returns false if no such basis is found, because of blocks of
/// several modes that cannot be separated, eigenvalues of equal sign characteristic in one mode, or
/// a stiffness that is not positive definite and has no factor.
bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                 BlockEigenbasis& basis) noexcept;

/// Makes the columns of `basis` span the planes of the modes of `spectrum`. Such a basis serves
/// only for matching later modes, not as a start for Newton's method.
void set_planes(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum,
                BlockEigenbasis& basis) noexcept;

/// Matches the modes of `basis` to the modes of `before` that they resemble, the most alike first:
/// in the overlap of the planes that two modes span (modal assurance criterion in the energy
/// metric). Mode i of `basis` becomes mode index[i]. Both bases have the same number of
/// vibrations.
std::array<int, kMaxDof> match_modes(const SymmetricPencil& pencil, const BlockEigenbasis& before,
                                     BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
