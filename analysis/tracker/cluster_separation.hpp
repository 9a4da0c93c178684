#pragma once
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>
#include <dashpot/analysis/work.hpp>

namespace dashpot::analysis {

/// Parts two blocks that Newton's method cannot tell apart, by solving the eigenvalue problem of
/// their four columns (three with a zero mode, two with two of them) again. Real eigenvalues are
/// paired so that the two of opposite sign type that are nearest each other share a block: only
/// those can meet and turn complex. Each new block takes the place of the one it has more of.
/// `residual` is one of the basis, or nearly. Returns false, and leaves the basis, where no
/// well-conditioned columns part them: a defective eigenvalue of two modes.
bool separate_blocks(const TrackedResidual& residual, const CloseBlocks& close,
                     BlockEigenbasis& basis) noexcept;

/// Modes whose eigenvalues coincide share a space of which any orthonormal columns will do: gives
/// each of them a plane that is orthogonal to the others', in the metric and in the energy, and as
/// well conditioned as the space allows. What a direct solution has instead depends on rounding
/// errors. `residual` is one of the basis; returns whether there were any such modes. Those for
/// which `work` does not grant enough stay as they are.
bool separate_coinciding(const TrackedResidual& residual, BlockEigenbasis& basis,
                         Work& work) noexcept;

/// Turns the columns of the zero modes, which are orthonormal or nearly so, until the damping tells
/// them apart, all at once. `residual` is one of the basis, or nearly. False if it is not finite.
bool separate_zero_modes(const TrackedResidual& residual, BlockEigenbasis& basis) noexcept;

}  // namespace dashpot::analysis
