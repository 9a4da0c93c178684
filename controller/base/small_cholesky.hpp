#pragma once
#include <dashpot/controller/robot_types.hpp>

#include <array>

namespace dashpot::controller {

/// Cholesky factorisation A = L L' of a symmetric positive definite n x n matrix A, n at most
/// kMaxJoints, of which the lower triangle counts. Pivots below `least_pivot` are raised to
/// `least_pivot`, so that the factor is finite for every finite A.
class SmallCholesky {
 public:
  void compute(const Eigen::Ref<const Eigen::MatrixXd>& A, double least_pivot) noexcept;

  /// Returns L_ij for i >= j.
  double L(int i, int j) const noexcept { return column(j)[i]; }
  double per_diagonal(int i) const noexcept { return per_diagonal_[static_cast<std::size_t>(i)]; }

  // x has n entries.
  void solve_L(double* x) const noexcept;      ///< x <- L^-1 x
  void solve_LT(double* x) const noexcept;     ///< x <- L^-T x
  void multiply_L(double* x) const noexcept;   ///< x <- L x
  void multiply_LT(double* x) const noexcept;  ///< x <- L' x

 private:
  const double* column(int j) const noexcept { return L_.data() + j * kMaxJoints; }
  double* column(int j) noexcept { return L_.data() + j * kMaxJoints; }

  int n_ = 0;
  std::array<double, kMaxJoints> per_diagonal_;                  ///< 1 / L_ii
  alignas(64) std::array<double, kMaxJoints * kMaxJoints> L_{};  ///< by columns
};

/// A^1/2 = sum of root_k v_k v_k', with orthonormal v_k.
struct SymmetricRoot {
  JointVector roots;                            ///< n
  std::array<JointVector, kMaxJoints> vectors;  ///< v_k, n each
};

/// Returns the root of a symmetric A (n x n), of which the lower triangle is read. Eigenvalues
/// below 1e-13 of the largest entry count as zero, because they may be rounding errors of zeros.
/// Jacobi rotations in at most 12 sweeps, so that the work is bounded; the root of a finite A is
/// finite.
SymmetricRoot symmetric_root(const JointMatrix& A) noexcept;

}  // namespace dashpot::controller
