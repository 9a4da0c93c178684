#pragma once
#include <dashpot/analysis/tracker/coefficient_sizes.hpp>

namespace dashpot::analysis {

/// The proved bounds of the blocks of a basis.
struct TrackedEnclosure {
  /// For each block, 1/s: the exact system is similar to one whose block (of the group that the
  /// block belongs to) differs from Lambda's block by at most this in the spectral norm. Infinite
  /// if nothing can be proved, and for zero modes that are a group by themselves.
  std::array<double, kMaxDof> radius{};
  std::array<int, kMaxDof> group{};  ///< for each block: one block of its group
  std::array<bool, kMaxDof> alone{};
  /// Bound of the rounding errors of all of G (Frobenius norm), 1/s: smaller couplings say nothing.
  double roundoff_bound = 0;
};

/// Computes bounds by Stewart's theorem (see enclosure.hpp) in the metric of the basis. The bounds
/// include the rounding errors of `residual`. They hold for a system at this `distance` from the
/// one that was evaluated.
void enclose(const SymmetricPencil& pencil, const CoefficientSizes& sizes, double distance,
             const BlockEigenbasis& basis, const TrackedResidual& residual,
             TrackedEnclosure& enclosure) noexcept;

}  // namespace dashpot::analysis
