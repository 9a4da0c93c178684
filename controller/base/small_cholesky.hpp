#pragma once
#include <dashpot/controller/types.hpp>

#include <Eigen/Core>
#include <cmath>

namespace dashpot::controller {

/// Cholesky factorisation A = L L' of a symmetric positive definite A of fixed small size, of which
/// the lower triangle is read. Pivots below `least_pivot` are raised to `least_pivot`, so that the
/// factor is finite for every finite A.
template <int N>
class SmallCholesky {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  void compute(const Eigen::Matrix<double, N, N>& A, double least_pivot) noexcept {
    for (int j = 0; j < N; ++j) {
      for (int i = j; i < N; ++i) L_(i, j) = A(i, j);
    }
    for (int k = 0; k < N; ++k) {
      const double pivot = L_(k, k) > least_pivot ? L_(k, k) : least_pivot;
      L_(k, k) = std::sqrt(pivot);
      per_diagonal_[k] = 1 / L_(k, k);
      for (int i = k + 1; i < N; ++i) L_(i, k) *= per_diagonal_[k];
      for (int j = k + 1; j < N; ++j) {
        const double factor = L_(j, k);
        for (int i = j; i < N; ++i) L_(i, j) -= L_(i, k) * factor;
      }
    }
  }

  /// Returns L_ij for i >= j.
  double L(int i, int j) const noexcept { return L_(i, j); }
  double per_diagonal(int i) const noexcept { return per_diagonal_[i]; }

  /// x <- L^-1 x
  template <class X>
  void solve_L(X& x) const noexcept {
    for (int i = 0; i < N; ++i) {
      x[i] *= per_diagonal_[i];
      for (int j = i + 1; j < N; ++j) x[j] -= L_(j, i) * x[i];
    }
  }
  /// x <- L^-T x
  template <class X>
  void solve_LT(X& x) const noexcept {
    for (int i = N - 1; i >= 0; --i) {
      double sum = x[i];
      for (int j = i + 1; j < N; ++j) sum -= L_(j, i) * x[j];
      x[i] = sum * per_diagonal_[i];
    }
  }
  /// x <- L x
  template <class X>
  void multiply_L(X& x) const noexcept {
    for (int i = N - 1; i >= 0; --i) {
      for (int j = i + 1; j < N; ++j) x[j] += L_(j, i) * x[i];
      x[i] *= L_(i, i);
    }
  }
  /// x <- L' x
  template <class X>
  void multiply_LT(X& x) const noexcept {
    for (int i = 0; i < N; ++i) {
      x[i] *= L_(i, i);
      for (int j = i + 1; j < N; ++j) x[i] += L_(j, i) * x[j];
    }
  }
  /// Returns L^-1.
  Eigen::Matrix<double, N, N> inverse_L() const noexcept {
    Eigen::Matrix<double, N, N> X = Eigen::Matrix<double, N, N>::Zero();
    for (int k = 0; k < N; ++k) {
      X(k, k) = per_diagonal_[k];
      for (int j = k + 1; j < N; ++j) {
        double sum = 0;
        for (int i = k; i < j; ++i) sum -= L_(j, i) * X(i, k);
        X(j, k) = sum * per_diagonal_[j];
      }
    }
    return X;
  }

 private:
  Eigen::Matrix<double, N, N> L_;
  Vector per_diagonal_;  ///< 1 / L_ii
};

}  // namespace dashpot::controller
