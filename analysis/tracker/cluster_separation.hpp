#pragma once
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Separates two blocks that Newton's method cannot tell apart, by solving the eigenvalue problem
/// of their four columns again (three columns with a zero mode, two with two zero modes). Real
/// eigenvalues are paired so that the two of opposite sign characteristic that are nearest each
/// other share a block, because only such a pair can meet and turn complex. Each new block gets the
/// index of the old block that it has more of.
///
/// `residual` belongs to the basis, at least nearly. Returns false, and does not change the basis,
/// where no well-conditioned columns separate the blocks: a defective eigenvalue of two modes.
bool separate_blocks(const TrackedResidual& residual, const CloseBlocks& close,
                     BlockEigenbasis& basis) noexcept;

/// Rotates the columns of the zero modes, all at once, until the damping tells them apart. The
/// columns are orthonormal, or nearly. `residual` belongs to the basis, at least nearly. Returns
/// false if it is not finite.
bool separate_zero_modes(const TrackedResidual& residual, BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
