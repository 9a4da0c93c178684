#pragma once
#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/matrix_types.hpp>
#include <dashpot/analysis/work.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace dashpot::analysis {

/// Reduces A to upper Hessenberg form by a similarity of Householder reflections, in place. Entries
/// below the first subdiagonal are set to zero. (Golub and Van Loan, Matrix Computations, 4th ed.,
/// Algorithm 7.4.2.)
template <typename Matrix>
void reduce_to_hessenberg(Matrix& A) noexcept {
  const Eigen::Index n = A.rows();
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, Matrix::MaxRowsAtCompileTime, 1> y(n);
  for (Eigen::Index k = 0; k + 2 < n; ++k) {
    double* const x = &A(0, k);  // rows k+1 .. n-1 of it become the reflection's vector
    double tail = 0;
    for (Eigen::Index i = k + 2; i < n; ++i) tail += x[i] * x[i];
    if (tail == 0) continue;
    const double norm = std::sqrt(x[k + 1] * x[k + 1] + tail);
    const double alpha = x[k + 1] > 0 ? -norm : norm;
    // Reflection I - tau v v' with v = [1; x_i / v0], kept where the zeros will be.
    const double v0 = x[k + 1] - alpha;
    const double tau = -v0 / alpha;
    const double inverse = 1 / v0;
    x[k + 1] = 1;
    for (Eigen::Index i = k + 2; i < n; ++i) x[i] *= inverse;
    y.setZero();
    for (Eigen::Index j = k + 1; j < n; ++j) {
      double* const column = &A(0, j);
      subtract_multiple(column, x, tau * dot(x, column, k + 1, n), k + 1, n);
      subtract_multiple(y.data(), column, -tau * x[j], 0, n);
    }
    for (Eigen::Index j = k + 1; j < n; ++j) subtract_multiple(&A(0, j), y.data(), x[j], 0, n);
    x[k + 1] = alpha;
    for (Eigen::Index i = k + 2; i < n; ++i) x[i] = 0;
  }
}

/// Computes the two eigenvalues of [a b; c d]. The pair is exactly conjugate or exactly real.
inline void eigenvalues_2x2(double a, double b, double c, double d, Complex& first,
                            Complex& second) noexcept {
  const double half_difference = 0.5 * (a - d);
  const double discriminant = half_difference * half_difference + b * c;
  if (discriminant >= 0) {
    const double root = std::sqrt(discriminant);
    const double shift = half_difference >= 0 ? half_difference + root : half_difference - root;
    first = d + shift;
    second = shift != 0 ? d - b * c / shift : d;
  } else {
    const double root = std::sqrt(-discriminant);
    first = Complex(d + half_difference, root);
    second = std::conj(first);
  }
}

/// Returns an eigenvector of [a b; c d], from the row of [a b; c d] - value that says more.
inline std::array<Complex, 2> eigenvector_2x2(double a, double b, double c, double d,
                                              const Complex& value) noexcept {
  const Complex p = a - value, s = d - value;
  const bool upper = std::norm(p) + b * b >= std::norm(s) + c * c;
  const std::array<Complex, 2> w =
      upper ? std::array<Complex, 2>{b, -p} : std::array{-s, Complex(c)};
  return w[0] == 0.0 && w[1] == 0.0 ? std::array<Complex, 2>{1, 0} : w;
}

/// Computes the eigenvalues of an upper Hessenberg matrix by the implicit double-shift QR iteration
/// of Francis; `H` is destroyed. Only the active window is changed, because no vectors are wanted.
/// It takes at most 40 sweeps per row of H in total, and 160 more, because a cluster of nearly
/// defective eigenvalues may need them all by itself. Returns false if these are not enough, or are
/// more than `work` grants. (Golub and Van Loan, 4th ed., Algorithm 7.5.2.)
template <typename Matrix>
bool hessenberg_eigenvalues(Matrix& H, Complex* eigenvalues, Work& work) noexcept {
  const Eigen::Index n = H.rows();
  double norm = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i <= std::min(j + 1, n - 1); ++i) norm += std::abs(H(i, j));
  }
  Eigen::Index high = n - 1;
  int sweeps = 0;  // since the last eigenvalue was found
  Eigen::Index budget = 40 * n + 160;
  while (high >= 0) {
    Eigen::Index low = high;
    while (low > 0) {
      // Near a defective eigenvalue progress ends at rounding errors of the whole matrix.
      double scale = std::abs(H(low - 1, low - 1)) + std::abs(H(low, low));
      if (scale == 0 || sweeps > 10) scale = norm;
      if (std::abs(H(low, low - 1)) <= kEps * scale) break;
      --low;
    }
    if (low == high) {
      eigenvalues[high] = H(high, high);
      --high;
      sweeps = 0;
      continue;
    }
    if (low + 1 == high) {
      eigenvalues_2x2(H(low, low), H(low, high), H(high, low), H(high, high), eigenvalues[low],
                      eigenvalues[high]);
      high -= 2;
      sweeps = 0;
      continue;
    }
    ++sweeps;
    if (--budget < 0) return false;
    const std::int64_t window = high - low + 1;
    if (!work.take(squared(window, 38) + 160 * window)) return false;
    // Shifts: eigenvalues of the trailing block [a b; c d], or, where progress stalls, of
    // d I + size [0.75 -0.4375; 1 0.75]. They are kept as a, d and bc, because in a cluster of
    // eigenvalues their trace and determinant would cancel against entries of H.
    double a = H(high - 1, high - 1), d = H(high, high);
    double bc = H(high - 1, high) * H(high, high - 1);
    if (sweeps % 10 == 0) {
      const double size = std::abs(H(high, high - 1)) + std::abs(H(high - 1, high - 2));
      a = d = d + 0.75 * size;
      bc = -0.4375 * size * size;
    }
    // First column of (H - s1)(H - s2), started at the lowest row where two subdiagonal entries are
    // small together.
    double x = 0, y = 0, z = 0;
    Eigen::Index start = high - 2;
    for (;; --start) {
      const double h = H(start, start);
      x = (h - a) * (h - d) - bc + H(start, start + 1) * H(start + 1, start);
      y = H(start + 1, start) * ((h - a) + (H(start + 1, start + 1) - d));
      z = H(start + 1, start) * H(start + 2, start + 1);
      const double size = std::abs(x) + std::abs(y) + std::abs(z);
      if (size != 0) x /= size, y /= size, z /= size;
      if (start == low) break;
      const double left = std::abs(H(start, start - 1)) * (std::abs(y) + std::abs(z));
      const double right = std::abs(x) * (std::abs(H(start - 1, start - 1)) + std::abs(h) +
                                          std::abs(H(start + 1, start + 1)));
      if (left <= kEps * right) break;
    }
    for (Eigen::Index k = start; k < high; ++k) {
      const bool three = k + 2 <= high;
      if (k > start) {
        x = H(k, k - 1);
        y = H(k + 1, k - 1);
        z = three ? H(k + 2, k - 1) : 0;
      }
      const double length = std::sqrt(x * x + y * y + z * z);
      if (length == 0) continue;
      const double alpha = x > 0 ? -length : length;
      if (k > start) {
        H(k, k - 1) = alpha;
        H(k + 1, k - 1) = 0;
        if (three) H(k + 2, k - 1) = 0;
      } else if (start > low) {
        H(k, k - 1) = -H(k, k - 1);
      }
      // Reflection I - [v0 v1 v2]' [1 w1 w2]
      const double inverse_alpha = 1 / alpha, inverse_rest = 1 / (x - alpha);
      const double v0 = 1 - x * inverse_alpha;
      const double v1 = -y * inverse_alpha;
      const double v2 = -z * inverse_alpha;
      const double w1 = y * inverse_rest;
      const double w2 = z * inverse_rest;
      const Eigen::Index last_row = std::min(high, k + 3);
      double* row = &H(k, k);
      const Eigen::Index stride = H.outerStride();
      double* const c0 = &H(0, k);
      double* const c1 = c0 + stride;
      if (three) {
        for (Eigen::Index j = k; j <= high; ++j, row += stride) {
          const double p = row[0] + w1 * row[1] + w2 * row[2];
          row[0] -= p * v0;
          row[1] -= p * v1;
          row[2] -= p * v2;
        }
        double* const c2 = c1 + stride;
        for (Eigen::Index i = low; i <= last_row; ++i) {
          const double p = v0 * c0[i] + v1 * c1[i] + v2 * c2[i];
          c0[i] -= p;
          c1[i] -= p * w1;
          c2[i] -= p * w2;
        }
      } else {
        for (Eigen::Index j = k; j <= high; ++j, row += stride) {
          const double p = row[0] + w1 * row[1];
          row[0] -= p * v0;
          row[1] -= p * v1;
        }
        for (Eigen::Index i = low; i <= last_row; ++i) {
          const double p = v0 * c0[i] + v1 * c1[i];
          c0[i] -= p;
          c1[i] -= p * w1;
        }
      }
    }
  }
  return true;
}

template <typename Matrix>
bool hessenberg_eigenvalues(Matrix& H, Complex* eigenvalues) noexcept {
  Work work;
  return hessenberg_eigenvalues(H, eigenvalues, work);
}

}  // namespace dashpot::analysis
