#pragma once
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

namespace dashpot::analysis {

/// Sizes of the coefficients, for bounds of rounding errors and of small changes. With
/// s_k = sqrt(M_kk), entrywise |M| <= mass s s', |C| <= damping s s' and |K| <= stiffness^2 s s'
/// (without a factor). Column k of W is no longer than elastic[k].
struct CoefficientSizes {
  std::array<double, kMaxDof> s{}, elastic{};
  double mass = 0, damping = 0, stiffness = 0;
  bool in_range = false;  ///< no product that matters can underflow or overflow
};
CoefficientSizes coefficient_sizes(const SymmetricPencil& pencil) noexcept;

/// Returns the distance of two systems of the same sizes: the least d with |M - M'| <= d mass s s',
/// |C - C'| <= d damping s s', and likewise for K or the columns of W. Entries of the symmetric
/// matrices are finite, and their upper triangles are read. The distance is infinite if W is not
/// finite, and as soon as it is seen to exceed `limit`.
double distance(const SymmetricPencil& pencil, const SymmetricPencil& other,
                const CoefficientSizes& sizes, double limit) noexcept;

}  // namespace dashpot::analysis
