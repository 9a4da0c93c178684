#pragma once
#include <dashpot/analysis/matrix_types.hpp>

#include <cmath>
#include <limits>

namespace dashpot::analysis {

/// Computes F (n x n, lower triangular) with K = F F' for a symmetric positive semidefinite K, of
/// which the lower triangle is read. A pivot that is zero to rounding ends its column; the rest of
/// the column then has to be zero too. Returns false, with F incomplete, unless K is semidefinite
/// to rounding.
template <class Symmetric, class Matrix>
bool semidefinite_cholesky(const Symmetric& K, Matrix& F) noexcept {
  const Eigen::Index n = K.rows();
  F.setZero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double rounding =
        16 * static_cast<double>(n) * std::numeric_limits<double>::epsilon() * std::abs(K(j, j));
    double pivot = K(j, j);
    for (Eigen::Index k = 0; k < j; ++k) pivot -= F(j, k) * F(j, k);
    if (pivot < -rounding) return false;
    const bool zero = pivot <= rounding;
    for (Eigen::Index i = j; i < n; ++i) {
      double rest = K(i, j);
      for (Eigen::Index k = 0; k < j; ++k) rest -= F(i, k) * F(j, k);
      if (!zero) F(i, j) = rest / std::sqrt(pivot);
      // |rest|^2 <= pivot_i pivot_j for a semidefinite matrix
      if (zero && rest * rest > 64 * rounding * std::abs(K(i, i))) return false;
    }
  }
  return true;
}

}  // namespace dashpot::analysis
