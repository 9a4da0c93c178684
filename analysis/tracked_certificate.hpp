#pragma once
#include <dashpot/analysis/tracked_basis.hpp>

namespace dashpot::analysis {

/// Sizes of the coefficients, for bounds of rounding errors and of small changes: with
/// s_k = sqrt(M_kk), entrywise |M| <= mass s s', |C| <= damping s s' and |K| <= stiffness^2 s s'
/// (without a factor), and columns of W are no longer than strain(k).
struct CoefficientSizes {
  std::array<double, kMaxDof> s{}, strain{};
  double mass = 0, damping = 0, stiffness = 0;
  bool in_range = false;  ///< no product that matters can underflow or overflow
};
CoefficientSizes coefficient_sizes(const StateForm& form) noexcept;

/// How far two systems of the same sizes differ: the least d with |M - M'| <= d mass s s',
/// |C - C'| <= d damping s s', and likewise for K or the columns of W. All entries are finite, and
/// of symmetric matrices the upper triangles are read. Infinite as soon as it is seen to exceed
/// `limit`.
double distance(const StateForm& form, const StateForm& other, const CoefficientSizes& sizes,
                double limit) noexcept;

/// What is proved about the blocks of a basis.
struct TrackedCertificate {
  /// For each block, 1/s: the exact system is similar to one whose block (of the group that the
  /// block belongs to) differs from Lambda's by at most this in the spectral norm; infinite if
  /// nothing can be proved, and for zero modes on their own.
  std::array<double, kMaxDof> radius{};
  std::array<int, kMaxDof> group{};  ///< for each block: one block of its group
  std::array<bool, kMaxDof> alone{};
  /// Rounding errors of all of G (Frobenius norm), 1/s: smaller couplings say nothing.
  double noise = 0;
};

/// Bounds by Stewart's theorem (see certificate.hpp) in the metric of the basis: rounding errors
/// of `defect` are counted, and so is a system that lies at this `distance` from the one evaluated.
void certify(const StateForm& form, const CoefficientSizes& sizes, double distance,
             const TrackedBasis& basis, const TrackedDefect& defect,
             TrackedCertificate& certificate) noexcept;

}  // namespace dashpot::analysis
