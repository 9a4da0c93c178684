#pragma once
// What a system is to the tracker, before it is followed.

#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/tracker/block_eigenbasis.hpp>

#include <array>
#include <cmath>
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

/// Whether the symmetric matrix M (n x n) has a Cholesky factor.
inline bool is_positive_definite(const double* M, int n) {
  std::array<double, static_cast<std::size_t>(kMaxDof) * kMaxDof> L;  // by rows
  for (int i = 0; i < n; ++i) {
    double* const row = &L[at(i * kMaxDof)];
    double diagonal = M[i + i * n];
    for (int j = 0; j < i; ++j) {
      const double* const other = &L[at(j * kMaxDof)];
      double sum = M[i + j * n];
      for (int k = 0; k < j; ++k) sum -= row[k] * other[k];
      row[j] = sum * other[j];  // the inverses of the diagonal are kept
      diagonal -= row[j] * row[j];
    }
    if (!(diagonal > 0)) return false;
    row[i] = 1 / std::sqrt(diagonal);
  }
  return true;
}

/// Whether a basis can follow the system, which is symmetric or not, from one that was. A basis of
/// one side is dearer to find than to follow: a symmetric system gets it back at once.
inline bool can_follow(const BlockEigenbasis& basis, const System<kMaxDof>& system,
                       const SymmetricPencil& pencil, bool symmetric, bool was_symmetric) {
  if (!basis.two_sided) return symmetric;
  return (!symmetric || was_symmetric) && is_symmetric(system.mass) &&
         is_positive_definite(pencil.M, pencil.joints);
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
