#include <dashpot/analysis/linalg/packed_matrix.hpp>

#include <algorithm>
#include <cstddef>
#include <utility>

namespace dashpot::analysis {
namespace {

/// `Count` rows of the result at a time, each of V times four doubles.
template <int V, int Count>
void multiply_rows(const Strided& A, int first, int inner, const double* X, const double* start,
                   double sign, double* out, int stride) noexcept {
  std::array<std::array<Vec4d, V>, Count> sum{};
  if (start != nullptr) {
    const double* from = start + first * stride;
    for (auto& row : sum) {
      for (std::size_t v = 0; v < V; ++v) row[v] = load(from + 4 * v);
      from += stride;
    }
  }
  const double* a = A.data + first * A.row_step;
  const double* x = X;
  for (int k = 0; k < inner; ++k, a += A.column_step, x += stride) {
    for (int c = 0; c < Count; ++c) {
      const double factor = a[c * A.row_step];
      for (int v = 0; v < V; ++v) {
        sum[static_cast<std::size_t>(c)][static_cast<std::size_t>(v)] += factor * load(x + 4 * v);
      }
    }
  }
  double* to = out + first * stride;
  for (const auto& row : sum) {
    for (std::size_t v = 0; v < V; ++v) store(to + 4 * v, sign * row[v]);
    to += stride;
  }
}

template <int V>
void multiply_strided(const Strided& A, int rows, int inner, const double* X, const double* start,
                      double sign, double* out, int stride) noexcept {
  constexpr int kTogether = V <= 2 ? 4 : V <= 4 ? 2 : 1;  // as many as registers hold
  int i = 0;
  for (; i + kTogether <= rows; i += kTogether) {
    multiply_rows<V, kTogether>(A, i, inner, X, start, sign, out, stride);
  }
  for (; i < rows; ++i) multiply_rows<V, 1>(A, i, inner, X, start, sign, out, stride);
}

template <int... I>
constexpr std::array<PaddedMultiply, sizeof...(I)> table(std::integer_sequence<int, I...>) {
  return {multiply_strided<I + 1>...};
}

}  // namespace

void set_zero(int width, int rows, PackedMatrix& X) noexcept {
  X.width = width;
  std::fill_n(X.items.begin(), rows * width, 0.0);
}

void copy(const PackedMatrix& X, int rows, PackedMatrix& out) noexcept {
  out.width = X.width;
  std::copy_n(X.items.begin(), rows * X.width, out.items.begin());
}

PaddedMultiply padded_multiply(int columns) noexcept {
  static constexpr auto kTable = table(std::make_integer_sequence<int, kMaxWidth / 4>());
  return kTable[static_cast<std::size_t>((columns + 3) / 4 - 1)];
}

}  // namespace dashpot::analysis
