#pragma once
// Sylvester equations A X - X B = Q of real 2 x 2 blocks: of one block (double), or of one in each
// lane (Vec4d).

#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/packed_matrix.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>

#include <cmath>

namespace dashpot::analysis {

/// [a b; c d]
template <typename T>
struct Block2 {
  T a, b, c, d;

  T trace() const { return a + d; }
  T determinant() const { return a * d - b * c; }
  T squared_norm() const { return a * a + d * d + (b * b + c * c); }
};

/// Solves A X - X B = Q. With p the characteristic polynomial of B, p(A) X = A Q - Q adj(B) (Cayley
/// and Hamilton). X is not finite if A and B have a common eigenvalue.
template <typename T, typename U>
Block2<U> solve_sylvester(const Block2<T>& A, const Block2<U>& B, const Block2<U>& Q) noexcept {
  const U trace = B.trace();
  const U across = A.trace() - trace, product = A.b * A.c + B.determinant();
  const U p00 = A.a * (A.a - trace) + product, p11 = A.d * (A.d - trace) + product;
  const U p01 = A.b * across, p10 = A.c * across;
  const U inverse = 1 / (p00 * p11 - p01 * p10);
  const U r00 = A.a * Q.a + A.b * Q.c - (Q.a * B.d - Q.b * B.c);
  const U r01 = A.a * Q.b + A.b * Q.d - (Q.b * B.a - Q.a * B.b);
  const U r10 = A.c * Q.a + A.d * Q.c - (Q.c * B.d - Q.d * B.c);
  const U r11 = A.c * Q.b + A.d * Q.d - (Q.d * B.a - Q.c * B.b);
  return {inverse * (p11 * r00 - p01 * r10), inverse * (p11 * r01 - p01 * r11),
          inverse * (p00 * r10 - p10 * r00), inverse * (p00 * r11 - p10 * r01)};
}

/// A block with what bounds its separation from others.
template <typename T>
struct MeasuredBlock : Block2<T> {
  explicit MeasuredBlock(const Block2<T>& block)
      : Block2<T>(block),
        size2(block.squared_norm()),
        traceless(square_root(0.5 * (block.a - block.d) * (block.a - block.d) +
                              (block.b * block.b + block.c * block.c))) {}

  T size2, traceless;  ///< Frobenius norm, squared, and without the trace
};

/// Returns a lower bound of sep(A, B), the smallest singular value of X -> A X - X B; it is not
/// positive, or not a number, if none is found. As p(A) X = (A - t/2) Q + Q (B - t/2), t = tr B, it
/// is at least s_min(p(A)) / (|A - t/2| + |B - t/2|). The rounding errors are subtracted.
template <typename T, typename U>
U separation(const MeasuredBlock<T>& A, const MeasuredBlock<U>& B) noexcept {
  constexpr double kRounding = 32 * kEps;
  const U trace = B.trace();
  const U across = A.trace() - trace, product = A.b * A.c + B.determinant();
  const U p00 = A.a * (A.a - trace) + product, p11 = A.d * (A.d - trace) + product;
  const U p01 = A.b * across, p10 = A.c * across;
  // s_min = |det p| / s_max, with s_max at most the Frobenius norm.
  const U norm = square_root(p00 * p00 + p01 * p01 + (p10 * p10 + p11 * p11));
  const U rounding = kRounding * (A.size2 + trace * trace + B.size2);
  const U halves = A.traceless + B.traceless + 0.7072 * magnitude(across);
  return (magnitude(p00 * p11 - p01 * p10) - rounding * norm) / (norm * halves);
}

/// Returns the separation of a block of one entry x from B.
template <typename U>
U separation(double x, const MeasuredBlock<U>& B) noexcept {
  constexpr double kRounding = 32 * kEps;
  const U trace = B.trace();
  const U least = magnitude(x * x - trace * x + B.determinant()) -
                  kRounding * (x * x + trace * trace + B.size2);
  return least / (magnitude(x - 0.5 * trace) + B.traceless);
}

}  // namespace dashpot::analysis
