#pragma once
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Separates two blocks that Newton's method cannot tell apart, by dividing the space of their
/// columns into two invariant planes again (a plane and a line with a zero mode, lines of two).
/// In the division that is chosen, each new block has most of the old one whose index it gets. In
/// a basis of one side the blocks are orthonormal, and of real eigenvalues the two of opposite sign
/// characteristic that are nearest each other share a block, because only such a pair can meet and
/// turn complex. Zero modes of such a basis are separated all at once.
///
/// `residual` belongs to the basis, at least nearly. Returns false, and does not change the basis,
/// where no well-conditioned columns separate the blocks: a defective eigenvalue of two modes.
bool separate_blocks(const TrackedResidual& residual, const CloseBlocks& close,
                     BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
