#pragma once
#include <dashpot/analysis/spectrum/enclosure.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// The proved bounds of the blocks of a basis.
struct TrackedEnclosure : BlockEnclosure<kMaxDof> {
  /// Bound of the rounding errors of all of G (Frobenius norm), 1/s: smaller couplings say nothing.
  double roundoff_bound = 0;
};

/// Computes bounds by Stewart's theorem (see enclosure.hpp) in the metric of the basis. The bounds
/// include the rounding errors of `residual`.
void enclose(const SymmetricPencil& pencil, const BlockEigenbasis& basis,
             const TrackedResidual& residual, TrackedEnclosure& enclosure) noexcept;

}  // namespace dashpot::analysis
