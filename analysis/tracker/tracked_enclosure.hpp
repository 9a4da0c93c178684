#pragma once
#include <dashpot/analysis/tracker/coefficient_sizes.hpp>

namespace dashpot::analysis {

/// What is proved about the blocks of a basis.
struct TrackedEnclosure {
  /// For each block, 1/s: the exact system is similar to one whose block (of the group that the
  /// block belongs to) differs from Lambda's by at most this in the spectral norm; infinite if
  /// nothing can be proved, and for zero modes on their own.
  std::array<double, kMaxDof> radius{};
  std::array<int, kMaxDof> group{};  ///< for each block: one block of its group
  std::array<bool, kMaxDof> alone{};
  /// Rounding errors of all of G (Frobenius norm), 1/s: smaller couplings say nothing.
  double roundoff_bound = 0;
};

/// Bounds by Stewart's theorem (see enclosure.hpp) in the metric of the basis: rounding errors
/// of `residual` are counted, and so is a system that lies at this `distance` from the one
/// evaluated.
void enclose(const SymmetricPencil& pencil, const CoefficientSizes& sizes, double distance,
             const BlockEigenbasis& basis, const TrackedResidual& residual,
             TrackedEnclosure& enclosure) noexcept;

}  // namespace dashpot::analysis
