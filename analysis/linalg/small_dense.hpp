#pragma once
#include <dashpot/analysis/linalg/packed_matrix.hpp>
#include <dashpot/analysis/matrix_types.hpp>

#include <array>
#include <cmath>
#include <utility>

namespace dashpot::analysis {

// Dense kernels for the small matrices of one robot, where a blocked library kernel spends its time
// on set-up. All take max-size or dynamic Eigen matrices, allocate nothing, and cannot fail.

/// Returns a size that decides pivots. It is cheap, and within a factor of sqrt(2) of the modulus.
inline double magnitude(double x) noexcept {
  return std::abs(x);
}
inline double magnitude(const Complex& x) noexcept {
  return std::abs(x.real()) + std::abs(x.imag());
}

/// Multiplies without the checks for infinities that the standard demands for complex numbers.
inline double product(double a, double b) noexcept {
  return a * b;
}
inline Complex product(const Complex& a, const Complex& b) noexcept {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
inline double reciprocal(double a) noexcept {
  return 1 / a;
}
inline Complex reciprocal(const Complex& a) noexcept {
  const double scale = 1 / (std::abs(a.real()) + std::abs(a.imag()));
  const double re = a.real() * scale, im = a.imag() * scale;
  const double norm = scale / (re * re + im * im);
  return {re * norm, -im * norm};
}

/// y[i] -= x[i] factor for begin <= i < end, where x and y are apart.
inline void subtract_multiple(Complex* __restrict y, const Complex* __restrict x, Complex factor,
                              Eigen::Index begin, Eigen::Index end) noexcept {
  for (Eigen::Index i = begin; i < end; ++i) y[i] -= product(x[i], factor);
}
inline void subtract_multiple(double* y, const double* x, double factor, Eigen::Index begin,
                              Eigen::Index end) noexcept {
  Eigen::Index i = begin;
  for (; i + 4 <= end; i += 4) store(y + i, load(y + i) - load(x + i) * factor);
  for (; i < end; ++i) y[i] -= x[i] * factor;
}

/// Returns the sum of x[i] y[i] for begin <= i < end.
inline double dot(const double* x, const double* y, Eigen::Index begin, Eigen::Index end) noexcept {
  Vec4d fours{};
  Eigen::Index i = begin;
  for (; i + 4 <= end; i += 4) fours += load(x + i) * load(y + i);
  double rest = sum(fours);
  for (; i < end; ++i) rest += x[i] * y[i];
  return rest;
}

/// True if no entry is infinite or not a number. (Eigen's allFinite looks at one after the other.)
template <typename Matrix>
bool is_finite(const Matrix& X) noexcept {
  return (0 * X.array()).sum() == 0;
}

/// Solves A X = B in place (X overwrites B, A is destroyed) by Gaussian elimination with partial
/// pivoting. A pivot smaller than `least_pivot` is replaced by it, because inverse iteration may
/// pass a singular A.
template <typename Matrix, typename Rhs>
void solve_in_place(Matrix& A, Rhs& B, double least_pivot) noexcept {
  using Scalar = typename Matrix::Scalar;
  const Eigen::Index n = A.rows();
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::Index pivot = k;
    for (Eigen::Index i = k + 1; i < n; ++i) {
      if (magnitude(A(i, k)) > magnitude(A(pivot, k))) pivot = i;
    }
    if (pivot != k) {
      for (Eigen::Index j = k; j < n; ++j) std::swap(A(k, j), A(pivot, j));
      for (Eigen::Index j = 0; j < B.cols(); ++j) std::swap(B(k, j), B(pivot, j));
    }
    if (!(magnitude(A(k, k)) > least_pivot)) A(k, k) = Scalar(least_pivot);
    const Scalar inverse = reciprocal(A(k, k));
    Scalar* const factors = &A(0, k);
    for (Eigen::Index i = k + 1; i < n; ++i) factors[i] = product(factors[i], inverse);
    for (Eigen::Index j = k + 1; j < n; ++j)
      subtract_multiple(&A(0, j), factors, A(k, j), k + 1, n);
    for (Eigen::Index j = 0; j < B.cols(); ++j) {
      subtract_multiple(&B(0, j), factors, B(k, j), k + 1, n);
    }
    A(k, k) = inverse;
  }
  for (Eigen::Index j = 0; j < B.cols(); ++j) {
    for (Eigen::Index k = n; k-- > 0;) {
      B(k, j) = product(B(k, j), A(k, k));
      subtract_multiple(&B(0, j), &A(0, k), B(k, j), 0, k);
    }
  }
}

/// Makes the columns of S orthonormal (Gram-Schmidt, each column twice).
template <typename Matrix>
void orthonormalize(Matrix& S) noexcept {
  for (Eigen::Index j = 0; j < S.cols(); ++j) {
    for (int pass = 0; pass < 2; ++pass) {
      S.col(j) /= S.col(j).stableNorm();
      for (Eigen::Index k = 0; k < j; ++k) {
        const auto overlap = S.col(k).dot(S.col(j));
        S.col(j) -= overlap * S.col(k);
      }
    }
    S.col(j) /= S.col(j).stableNorm();
  }
}

/// Returns the index of the coordinate axis farthest from the span of the orthonormal columns of S.
template <typename Matrix>
Eigen::Index farthest_axis(const Matrix& S) noexcept {
  Eigen::Index farthest = 0;
  if (S.cols() == 0) return farthest;  // nothing stored: even the address of a row has no meaning
  for (Eigen::Index i = 1; i < S.rows(); ++i) {
    if (S.row(i).squaredNorm() < S.row(farthest).squaredNorm()) farthest = i;
  }
  return farthest;
}

namespace detail {

/// Multiplies A B where the number of rows of A is known to the compiler, which then keeps a column
/// of the result in registers: in fours, as far as they go.
template <int Rows>
void multiply_rows(const double* A, Eigen::Index A_stride, Eigen::Index inner, const double* B,
                   Eigen::Index B_stride, Eigen::Index columns, double* out,
                   Eigen::Index out_stride) noexcept {
  constexpr std::size_t kFours = Rows / 4, kRest = Rows % 4;
  for (Eigen::Index j = 0; j < columns; ++j) {
    std::array<Vec4d, kFours> sum{};
    std::array<double, kRest> rest{};
    for (Eigen::Index k = 0; k < inner; ++k) {
      const double b = B[k + j * B_stride];
      const double* const a = A + k * A_stride;
      for (std::size_t i = 0; i < kFours; ++i) sum[i] += load(a + 4 * i) * b;
      for (std::size_t i = 0; i < kRest; ++i) rest[i] += a[4 * kFours + i] * b;
    }
    double* const column = out + j * out_stride;
    for (std::size_t i = 0; i < kFours; ++i) store(column + 4 * i, sum[i]);
    for (std::size_t i = 0; i < kRest; ++i) column[4 * kFours + i] = rest[i];
  }
}

using MultiplyRows = void (*)(const double*, Eigen::Index, Eigen::Index, const double*,
                              Eigen::Index, Eigen::Index, double*, Eigen::Index) noexcept;

template <int... I>
constexpr std::array<MultiplyRows, sizeof...(I)> multiply_table(std::integer_sequence<int, I...>) {
  return {multiply_rows<I + 1>...};
}

inline constexpr auto kMultiplyRows =
    multiply_table(std::make_integer_sequence<int, 2 * kMaxDof>());

}  // namespace detail

/// Computes out = A B for column-major matrices; out must not be A or B, and is resized.
template <typename Left, typename Right, typename Out>
void multiply(const Left& A, const Right& B, Out& out) noexcept {
  out.resize(A.rows(), B.cols());
  if (A.rows() == 0) return;
  if (A.rows() > 2 * kMaxDof) {
    out.noalias() = A * B;
    return;
  }
  detail::kMultiplyRows[static_cast<std::size_t>(A.rows() - 1)](A.data(), A.outerStride(), A.cols(),
                                                                B.data(), B.outerStride(), B.cols(),
                                                                out.data(), out.outerStride());
}

}  // namespace dashpot::analysis
