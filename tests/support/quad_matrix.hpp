#pragma once
// Matrices of numbers with 33 decimal digits.
#include <Eigen/Core>
#include <utility>
#include <vector>

namespace dashpot::testing {

#if __LDBL_MANT_DIG__ == 113  // 64-bit ARM, which has no __float128
using Quad = long double;
#else
__extension__ typedef __float128 Quad;
#endif

inline Quad magnitude(Quad x) {
  return x < 0 ? -x : x;
}

/// Row by row.
struct QuadMatrix : std::vector<std::vector<Quad>> {
  using vector::vector;
};

inline QuadMatrix quad_matrix(const Eigen::MatrixXd& A) {
  QuadMatrix result(static_cast<std::size_t>(A.rows()));
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (const double a : A.row(i)) {
      result[static_cast<std::size_t>(i)].push_back(static_cast<Quad>(a));
    }
  }
  return result;
}

inline QuadMatrix operator*(const QuadMatrix& A, const QuadMatrix& B) {
  QuadMatrix C(A.size(), std::vector<Quad>(B[0].size()));
  for (std::size_t i = 0; i < A.size(); ++i) {
    for (std::size_t j = 0; j < B[0].size(); ++j) {
      for (std::size_t k = 0; k < B.size(); ++k) C[i][j] += A[i][k] * B[k][j];
    }
  }
  return C;
}

inline QuadMatrix operator+(QuadMatrix A, const QuadMatrix& B) {
  for (std::size_t i = 0; i < A.size(); ++i) {
    for (std::size_t j = 0; j < B[0].size(); ++j) A[i][j] += B[i][j];
  }
  return A;
}

/// Solves A X = B in place of B, by elimination with pivots. Destroys A.
inline void solve(QuadMatrix& A, QuadMatrix& B) {
  const std::size_t n = A.size(), columns = B[0].size();
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (magnitude(A[i][k]) > magnitude(A[pivot][k])) pivot = i;
    }
    std::swap(A[k], A[pivot]);
    std::swap(B[k], B[pivot]);
    for (std::size_t i = k + 1; i < n; ++i) {
      const Quad factor = A[i][k] / A[k][k];
      for (std::size_t j = k + 1; j < n; ++j) A[i][j] -= factor * A[k][j];
      for (std::size_t j = 0; j < columns; ++j) B[i][j] -= factor * B[k][j];
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    for (std::size_t j = 0; j < columns; ++j) {
      for (std::size_t i = k + 1; i < n; ++i) B[k][j] -= A[k][i] * B[i][j];
      B[k][j] /= A[k][k];
    }
  }
}

}  // namespace dashpot::testing
