#pragma once
// Factors of spring matrices: K = W' W, row by row.

#include <dashpot/controller/robot_types.hpp>

#include <array>

namespace dashpot::controller {

/// Returns W with W' W = A for a symmetric positive semidefinite A, by Cholesky factorisation with
/// the largest pivot first. W has as many rows as A; the last rows are zero if A has less than full
/// rank.
JointMatrix semidefinite_factor(JointMatrix A) noexcept;

/// Makes y orthogonal to the `count` orthonormal vectors Q, and of length 1. Returns false if the
/// orthogonal part of y is no longer than `least`.
bool orthonormalize(const JointVector* Q, int count, double least, JointVector& y) noexcept;

/// Replaces the lower triangle of A by its Cholesky factor. Returns false if A is not positive
/// definite beyond rounding, that is, 16 n eps of its trace.
bool lower_cholesky(JointMatrix& A, int n) noexcept;

/// The factor W of a symmetric positive semidefinite matrix that seldom changes. It is upper
/// triangular if the matrix is positive definite, and has no more rows than its rank.
class SpringFactor {
 public:
  /// `K` is n x n.
  void update(const double* K, int n) noexcept;
  const JointMatrix& matrix() const noexcept { return W_; }
  int rows() const noexcept { return rows_; }

 private:
  int rows_ = 0;
  JointMatrix K_;
  JointMatrix W_;
};

/// Stacked rows of n numbers, which can be reduced to n rows.
class FactorRows {
 public:
  /// Rows for the tip in two frames, null space and joints; a multiple of a line of the cache.
  static constexpr int kMost = 2 * kMaxJoints + 16;

  int size() const noexcept { return size_; }
  void clear() noexcept { size_ = 0; }
  void grow(int rows) noexcept { size_ += rows; }
  /// Returns entry j of row i past the last row.
  double& at(int i, int j) noexcept { return column(j)[size_ + i]; }
  /// Returns entry j of row i.
  double at_row(int i, int j) const noexcept { return column(j)[i]; }

  /// Replaces W by R, upper triangular with R' R = W' W and no negative diagonal entry, by
  /// Householder reflections. There must be at least n rows; they become n rows.
  void triangularize(int n) noexcept;

 private:
  double* column(int j) noexcept { return items_.data() + j * kMost; }
  const double* column(int j) const noexcept { return items_.data() + j * kMost; }

  int size_ = 0;
  alignas(64) std::array<double, kMaxJoints * kMost> items_{};
};

}  // namespace dashpot::controller
