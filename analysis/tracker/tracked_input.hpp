#pragma once
// What a system is to the tracker, before it is followed.

#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <cstring>

namespace dashpot::analysis {

/// Whether the matrix equals its transpose and its entries are finite.
inline bool is_symmetric(const Square<kMaxDof>& matrix) {
  const auto n = static_cast<int>(matrix.rows());
  const double* const a = matrix.data();
  bool differs = false;  // comparisons do not wait for each other, as the terms of a sum would
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < j; ++i) differs |= !(a[i + j * n] - a[j + i * n] == 0);
    differs |= !(0 * a[j + j * n] == 0);
  }
  return !differs;
}

/// Whether two systems have the same states.
inline bool same_form(const SymmetricPencil& a, const SymmetricPencil& b) {
  return a.joints == b.joints && a.rank == b.rank && a.factored == b.factored;
}

/// Whether all matrices that are read have the sizes that they need.
inline bool sizes_agree(const System<kMaxDof>& system) {
  const Eigen::Index n = system.dof();
  const Eigen::Index rows = system.stiffness_factor.rows();
  const bool factored = rows > 0 && rows <= n;
  const auto is_square = [n](const auto& matrix) {
    return matrix.rows() == n && matrix.cols() == n;
  };
  const auto is_bound = [&](const auto& matrix) { return matrix.size() == 0 || is_square(matrix); };
  return is_square(system.mass) && is_square(system.damping) && is_bound(system.mass_error) &&
         is_bound(system.damping_error) && is_bound(system.stiffness_error) &&
         (factored ? system.stiffness_factor.cols() == n : is_square(system.stiffness));
}

/// Whether coefficients are given with errors, which the bounds of a tracked basis do not count.
inline bool has_errors(const System<kMaxDof>& system) {
  return !system.mass_error.isZero(0) || !system.damping_error.isZero(0) ||
         !system.stiffness_error.isZero(0);
}

/// Whether all coefficients, of the same form, agree to the last bit.
inline bool identical(const SymmetricPencil& a, const SymmetricPencil& b) {
  const auto same = [](const double* x, const double* y, int count) {
    return std::memcmp(x, y, static_cast<std::size_t>(count) * sizeof(double)) == 0;
  };
  const int n = a.joints;
  return same(a.M, b.M, n * n) && same(a.C, b.C, n * n) && same(a.W, b.W, a.rank * n);
}

}  // namespace dashpot::analysis
