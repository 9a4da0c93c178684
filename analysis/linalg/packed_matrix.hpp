#pragma once
#include <array>
#include <cmath>
#include <cstring>

namespace dashpot::analysis {

/// Four doubles that the compiler keeps in one register, or in two.
using Vec4d = double __attribute__((vector_size(32)));

/// Copies four doubles from or to any address.
inline Vec4d load(const double* from) noexcept {
  Vec4d lanes;
  std::memcpy(&lanes, from, sizeof lanes);
  return lanes;
}
inline void store(double* to, const Vec4d& lanes) noexcept {
  std::memcpy(to, &lanes, sizeof lanes);
}

inline Vec4d magnitude(const Vec4d& x) noexcept {
  return x < Vec4d{} ? -x : x;
}

inline double square_root(double x) noexcept {
  return std::sqrt(x);
}
inline Vec4d square_root(Vec4d x) noexcept {
  for (int lane = 0; lane < 4; ++lane) x[lane] = std::sqrt(x[lane]);
  return x;
}

inline double sum(const Vec4d& x) noexcept {
  return (x[0] + x[1]) + (x[2] + x[3]);
}

/// Longest row, in doubles: an eigenvector matrix of 16 joints has this many columns.
inline constexpr int kMaxWidth = 32;

/// A matrix of at most 32 x 32, stored by rows of `width` doubles: its columns, padded to a
/// multiple of four. The padding holds finite numbers without meaning.
struct PackedMatrix {
  alignas(64) std::array<double, kMaxWidth * kMaxWidth> items{};
  int width = 4;

  double* row(int i) { return items.data() + i * width; }
  const double* row(int i) const { return items.data() + i * width; }
  double& operator()(int i, int j) { return row(i)[j]; }
  const double& operator()(int i, int j) const { return row(i)[j]; }
};

/// Sets X(i, j) = 0 in `rows` rows of this width.
void set_zero(int width, int rows, PackedMatrix& X) noexcept;
/// Copies X, of `rows` rows.
void copy(const PackedMatrix& X, int rows, PackedMatrix& out) noexcept;

/// A matrix whose entry (i, k) is data[i * row_step + k * column_step].
struct Strided {
  const double* data;
  int row_step, column_step;
};

/// Computes out = sign (start + A X) for `rows` rows, of A with `inner` columns. Rows of X, start
/// and out lie `stride` doubles apart. `start` may be null, for zero. `out` may hold A or start,
/// row by row, but not X.
using PaddedMultiply = void (*)(const Strided& A, int rows, int inner, const double* X,
                                const double* start, double sign, double* out, int stride) noexcept;

/// Returns the multiplication for this number of columns, rounded up to a multiple of 4, at most
/// kMaxWidth. It is compiled for each width by itself, so that rows of the result stay in
/// registers.
PaddedMultiply padded_multiply(int columns) noexcept;

}  // namespace dashpot::analysis
