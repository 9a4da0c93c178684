#pragma once
#include <dashpot/analysis/spectrum/spectrum_result.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Sets K = W'W of the factor with about 32 digits, as stiffness and its low word, and adds what
/// these lack at most to stiffness_error.
void form_stiffness(System<kMaxDof>& system) noexcept;

/// Builds a basis from the basis of a direct solution, in the order of the modes of `spectrum`,
/// with its residual before the last rotation of its blocks. It has one side if the system is
/// symmetric and its K has a factor or is positive definite: columns (W u, u Lambda), made
/// orthonormal in the indefinite metric mode by mode. Where a mode lost its stiffness (a singular
/// arm), its elastic coordinate is added, with a zero mode's velocity as its partner. Returns false
/// if no such basis is found, because of blocks of several modes that cannot be separated,
/// eigenvalues of equal sign characteristic in one mode, or zero modes that are not real.
bool start_basis(const SymmetricPencil& pencil, const Spectrum<kMaxDof>& spectrum, bool symmetric,
                 TrackedResidual& residual, BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
