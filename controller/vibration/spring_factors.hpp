#pragma once
// Factors of spring matrices: K = W' W, row by row.

#include <dashpot/controller/base/joint_algebra.hpp>

#include <array>
#include <cmath>
#include <limits>

namespace dashpot::controller {

/// Returns W with W' W = A for a symmetric positive semidefinite A, by Cholesky factorisation with
/// the largest pivot first. W has as many rows as A; the last rows are zero if A has less than full
/// rank.
template <int N>
JointSquare<N> semidefinite_factor(JointSquare<N> A) noexcept {
  JointSquare<N> W = JointSquare<N>::Zero();
  double least = 0;
  for (int k = 0; k < N; ++k) {
    int pivot = 0;
    for (int i = 1; i < N; ++i) {
      if (A(i, i) > A(pivot, pivot)) pivot = i;
    }
    if (k == 0) least = N * std::numeric_limits<double>::epsilon() * A(pivot, pivot);
    if (!(A(pivot, pivot) > least)) break;
    const double root = std::sqrt(A(pivot, pivot));
    for (int i = 0; i < N; ++i) W(k, i) = A(i, pivot) / root;
    for (int j = 0; j < N; ++j) {
      for (int i = 0; i < N; ++i) A(i, j) -= W(k, i) * W(k, j);
    }
    for (int i = 0; i < N; ++i) A(i, pivot) = A(pivot, i) = 0;
  }
  return W;
}

/// Returns a' b.
template <int N>
double product(const Joints<N>& a, const Joints<N>& b) noexcept {
  double sum = 0;
  for (int i = 0; i < N; ++i) sum += a[i] * b[i];
  return sum;
}

/// y -= q (q' y)
template <int N>
void remove_component(const Joints<N>& q, Joints<N>& y) noexcept {
  add<N>(q, y, -product<N>(q, y));
}

/// Makes y orthogonal to the `count` orthonormal vectors Q, and of length 1. Returns false if the
/// orthogonal part of y is no longer than `least`.
template <int N>
bool orthonormalize(const Joints<N>* Q, int count, double least, Joints<N>& y) noexcept {
  for (int pass = 0; pass < 2 && count > 0; ++pass) {
    for (int k = 0; k < count; ++k) remove_component<N>(Q[k], y);
  }
  const double length = std::sqrt(product<N>(y, y));
  if (!(length > least)) return false;
  for (int i = 0; i < N; ++i) y[i] /= length;
  return true;
}

/// Replaces the lower triangle of the r x r matrix A by its Cholesky factor. Returns false if A is
/// not positive definite beyond rounding.
template <int N>
bool lower_cholesky(int r, JointSquare<N>& A) noexcept {
  double trace = 0;
  for (int i = 0; i < r; ++i) trace += A(i, i);
  const double least = 16 * N * std::numeric_limits<double>::epsilon() * trace;
  for (int k = 0; k < r; ++k) {
    if (!(A(k, k) > least)) return false;
    A(k, k) = std::sqrt(A(k, k));
    for (int i = k + 1; i < r; ++i) A(i, k) /= A(k, k);
    for (int j = k + 1; j < r; ++j) {
      for (int i = j; i < r; ++i) A(i, j) -= A(i, k) * A(j, k);
    }
  }
  return true;
}

/// The factor W of a symmetric positive semidefinite matrix that seldom changes. It is upper
/// triangular if the matrix is positive definite, and has no more rows than its rank.
template <int N>
class SpringFactor {
 public:
  void update(const JointSquare<N>& K) noexcept {
    bool same = true;
    for (int i = 0; i < N * N; ++i) same &= K.data()[i] == K_.data()[i];
    if (same) return;
    K_ = K;
    JointSquare<N> L = K;
    if (lower_cholesky<N>(N, L)) {
      rows_ = N;
      for (int j = 0; j < N; ++j) {
        for (int i = 0; i < N; ++i) W_(i, j) = i <= j ? L(j, i) : 0;
      }
      return;
    }
    W_ = semidefinite_factor<N>(K);
    rows_ = 0;
    while (rows_ < N && row_is_there(rows_)) ++rows_;
  }
  const JointSquare<N>& matrix() const noexcept { return W_; }
  int rows() const noexcept { return rows_; }

 private:
  bool row_is_there(int i) const noexcept {
    bool any = false;
    for (int j = 0; j < N; ++j) any |= W_(i, j) != 0;
    return any;
  }

  JointSquare<N> K_ = JointSquare<N>::Zero();
  JointSquare<N> W_ = JointSquare<N>::Zero();
  int rows_ = 0;
};

/// Stacked rows of n numbers, which can be reduced to n rows.
template <int N>
class FactorRows {
 public:
  static constexpr int kMost = 2 * N + 12;  ///< rows of the tip in two frames, null space, joints

  int size() const noexcept { return size_; }
  void clear() noexcept { size_ = 0; }
  void grow(int rows) noexcept { size_ += rows; }
  /// Returns entry j of row i past the last row.
  double& at(int i, int j) noexcept { return column(j)[size_ + i]; }
  /// Returns entry j of row i.
  double at_row(int i, int j) const noexcept {
    return items_[place(j) + static_cast<std::size_t>(i)];
  }

  /// Replaces W by R, upper triangular with R' R = W' W and no negative diagonal entry, by
  /// Householder reflections. There must be at least n rows; they become n rows.
  void triangularize() noexcept {
    for (int k = 0; k < N; ++k) {
      double* const x = column(k);
      double tail = 0;
      for (int i = k + 1; i < size_; ++i) tail += x[i] * x[i];
      const double norm = std::sqrt(x[k] * x[k] + tail);
      if (!(norm > 0)) continue;
      // (I - v v' / (norm |v_k|)) x = -+norm e_k, with v = x +- norm e_k away from cancellation.
      const double side = x[k] > 0 ? 1 : -1;
      const double head = x[k] + side * norm, scale = 1 / (norm * std::abs(head));
      for (int j = k + 1; j < N; ++j) {
        double* const y = column(j);
        double dot = head * y[k];
        for (int i = k + 1; i < size_; ++i) dot += x[i] * y[i];
        dot *= scale;
        y[k] = -side * (y[k] - dot * head);
        for (int i = k + 1; i < size_; ++i) y[i] -= dot * x[i];
      }
      x[k] = norm;
      for (int i = k + 1; i < size_; ++i) x[i] = 0;
    }
    size_ = N;
  }

 private:
  static std::size_t place(int j) noexcept {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(kMost);
  }
  double* column(int j) noexcept { return items_.data() + place(j); }

  std::array<double, static_cast<std::size_t>(N) * static_cast<std::size_t>(kMost)> items_{};
  int size_ = 0;
};

}  // namespace dashpot::controller
