#pragma once
#include <dashpot/analysis/tracked_basis.hpp>

namespace dashpot::analysis {

/// Parts two blocks that Newton's method cannot tell apart, by solving the eigenvalue problem of
/// their four columns (three with a zero mode, two with two of them) anew. Real eigenvalues are
/// paired so that the two of opposite sign type that are nearest each other share a block: only
/// those can meet and turn complex. Each new block takes the place of the one it has more of.
/// `defect` is one of the basis, or nearly. Returns false, and leaves the basis, where no
/// well-conditioned columns part them: a defective eigenvalue of two modes.
bool part_blocks(const TrackedDefect& defect, const Conflict& conflict,
                 TrackedBasis& basis) noexcept;

}  // namespace dashpot::analysis
