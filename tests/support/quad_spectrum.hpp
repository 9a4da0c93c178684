#pragma once
// Eigenvalues of (l^2 M + l C + K) u = 0 with 33 decimal digits.
#include <dashpot/analysis/system.hpp>

#include <algorithm>
#include <complex>
#include <utility>
#include <vector>

namespace dashpot::testing {

#if __LDBL_MANT_DIG__ == 113  // 64-bit ARM, which has no __float128
using Quad = long double;
#else
__extension__ typedef __float128 Quad;
#endif

/// What std::complex does not promise for types of its own.
struct QuadComplex {
  Quad re = 0, im = 0;

  friend QuadComplex operator+(QuadComplex a, QuadComplex b) { return {a.re + b.re, a.im + b.im}; }
  friend QuadComplex operator-(QuadComplex a, QuadComplex b) { return {a.re - b.re, a.im - b.im}; }
  friend QuadComplex operator*(QuadComplex a, QuadComplex b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
  }
  friend QuadComplex operator/(QuadComplex a, QuadComplex b) {
    const Quad size = b.re * b.re + b.im * b.im;
    return {(a.re * b.re + a.im * b.im) / size, (a.im * b.re - a.re * b.im) / size};
  }
  /// |z|^2
  Quad norm() const { return re * re + im * im; }
};

inline QuadComplex to_quad(const std::complex<double>& z) {
  return {static_cast<Quad>(z.real()), static_cast<Quad>(z.imag())};
}

/// Row by row.
using QuadMatrix = std::vector<std::vector<QuadComplex>>;

inline QuadMatrix quad_matrix(const Eigen::MatrixXd& A) {
  QuadMatrix result(static_cast<std::size_t>(A.rows()));
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (const double a : A.row(i)) result[static_cast<std::size_t>(i)].push_back(to_quad(a));
  }
  return result;
}

inline QuadMatrix operator*(const QuadMatrix& A, const QuadMatrix& B) {
  QuadMatrix C(A.size(), std::vector<QuadComplex>(B[0].size()));
  for (std::size_t i = 0; i < A.size(); ++i) {
    for (std::size_t j = 0; j < B[0].size(); ++j) {
      for (std::size_t k = 0; k < B.size(); ++k) C[i][j] = C[i][j] + A[i][k] * B[k][j];
    }
  }
  return C;
}

inline QuadMatrix operator+(QuadMatrix A, const QuadMatrix& B) {
  for (std::size_t i = 0; i < A.size(); ++i) {
    for (std::size_t j = 0; j < B[0].size(); ++j) A[i][j] = A[i][j] + B[i][j];
  }
  return A;
}

/// Solves A X = B in place of B, by elimination with pivots. Destroys A.
inline void solve(QuadMatrix& A, QuadMatrix& B) {
  const std::size_t n = A.size();
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (A[i][k].norm() > A[pivot][k].norm()) pivot = i;
    }
    std::swap(A[k], A[pivot]);
    std::swap(B[k], B[pivot]);
    for (std::size_t i = k + 1; i < n; ++i) {
      const QuadComplex factor = A[i][k] / A[k][k];
      for (std::size_t j = k + 1; j < n; ++j) A[i][j] = A[i][j] - factor * A[k][j];
      for (std::size_t j = 0; j < n; ++j) B[i][j] = B[i][j] - factor * B[k][j];
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t i = k + 1; i < n; ++i) B[k][j] = B[k][j] - A[k][i] * B[i][j];
      B[k][j] = B[k][j] / A[k][k];
    }
  }
}

/// p'/p of p = det(l^2 M + l C + K), which is trace(Q^-1 Q').
inline QuadComplex logarithmic_derivative(const analysis::System<>& system, QuadComplex l) {
  const auto n = static_cast<std::size_t>(system.dof());
  QuadMatrix Q(n, std::vector<QuadComplex>(n)), dQ = Q;
  const auto scaled = [](QuadComplex z, double factor) -> QuadComplex {
    return {z.re * static_cast<Quad>(factor), z.im * static_cast<Quad>(factor)};
  };
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const auto row = static_cast<Eigen::Index>(i), column = static_cast<Eigen::Index>(j);
      const double M = system.mass(row, column), C = system.damping(row, column);
      Q[i][j] = scaled(l * l, M) + scaled(l, C) + to_quad(system.stiffness(row, column));
      dQ[i][j] = scaled(l, 2 * M) + to_quad(C);
    }
  }
  solve(Q, dQ);
  QuadComplex trace;
  for (std::size_t i = 0; i < n; ++i) trace = trace + dQ[i][i];
  return trace;
}

/// O. Aberth, Math. Comp. 27 (1973), from starting values of which no two are the same. Simple
/// eigenvalues get all digits; those at zero, where l^2 M + l C + K is singular, only come near it.
inline std::vector<QuadComplex> refine_eigenvalues(const analysis::System<>& system,
                                                   std::vector<QuadComplex> z) {
  constexpr int kMostSweeps = 40;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    Quad change = 0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      QuadComplex slope = logarithmic_derivative(system, z[i]);
      for (std::size_t j = 0; j < z.size(); ++j) {
        if (j != i) slope = slope - QuadComplex{1, 0} / (z[i] - z[j]);
      }
      const QuadComplex step = QuadComplex{1, 0} / slope;
      if (!(step.norm() >= 0)) continue;  // exactly a root
      z[i] = z[i] - step;
      change = std::max(change, step.norm() / z[i].norm());
    }
    if (change < Quad(1e-50)) break;  // squared
  }
  return z;
}

/// Largest relative error of `found`, each matched with the nearest true one that is left.
inline double largest_error(std::vector<QuadComplex> truth,
                            const std::vector<std::complex<double>>& found) {
  double largest = found.size() == truth.size() ? 0 : 1;
  for (const std::complex<double>& value : found) {
    if (truth.empty()) return 1;
    const QuadComplex z = to_quad(value);
    const auto nearest = std::min_element(
        truth.begin(), truth.end(),
        [&](QuadComplex a, QuadComplex b) { return (a - z).norm() < (b - z).norm(); });
    const auto squared = static_cast<double>((*nearest - z).norm() / nearest->norm());
    largest = std::max(largest, std::sqrt(squared));
    truth.erase(nearest);
  }
  return largest;
}

}  // namespace dashpot::testing
