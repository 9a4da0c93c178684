#pragma once
// Double-double arithmetic: a number kept as the unevaluated sum of two doubles, about 32 decimal
// digits, with the range of a double. It is used where a result of working precision is not enough:
// for residuals, and for products whose rounding errors are to be kept.
//
// Error bounds, u = 2^-53 (Joldes, Muller, Popescu, ACM TOMS 44(2), 2017): sum 3 u^2, product with
// a double 2 u^2, product 4 u^2, relative, barring overflow and underflow (below about 1e-290).
// Never compile this with -ffast-math, because rounding to nearest is assumed. Some compilers
// contract products and sums (gcc by itself, as far as a product has no other use). Therefore do
// not pass two_sum a product of the same expression; use two_product instead.

#include <cmath>

#ifdef __FAST_MATH__
#error "double_double.hpp relies on exact rounding: compile without -ffast-math"
#endif

namespace dashpot::analysis {

/// The number high + low, where high is the sum rounded to a double.
struct DoubleDouble {
  double high = 0;
  double low = 0;

  constexpr DoubleDouble() = default;
  constexpr DoubleDouble(double value) : high(value) {}  // NOLINT: as implicit as int to double
  constexpr DoubleDouble(double high_part, double low_part) : high(high_part), low(low_part) {}

  constexpr bool operator==(const DoubleDouble&) const = default;
};

/// Returns a + b exactly, for any a and b (Knuth).
constexpr DoubleDouble two_sum(double a, double b) {
  const double sum = a + b;
  const double b_part = sum - a;
  const double a_part = sum - b_part;
  return {sum, (a - a_part) + (b - b_part)};
}

/// Returns a + b exactly, if |a| >= |b| or a = 0 (Dekker).
constexpr DoubleDouble quick_two_sum(double a, double b) {
  const double sum = a + b;
  return {sum, b - (sum - a)};
}

/// Returns a b exactly.
inline DoubleDouble two_product(double a, double b) {
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
}

constexpr DoubleDouble operator-(const DoubleDouble& a) {
  return {-a.high, -a.low};
}

constexpr DoubleDouble operator+(const DoubleDouble& a, double b) {
  const DoubleDouble sum = two_sum(a.high, b);
  return quick_two_sum(sum.high, sum.low + a.low);
}

constexpr DoubleDouble operator+(const DoubleDouble& a, const DoubleDouble& b) {
  const DoubleDouble highs = two_sum(a.high, b.high);
  const DoubleDouble lows = two_sum(a.low, b.low);
  const DoubleDouble sum = quick_two_sum(highs.high, highs.low + lows.high);
  return quick_two_sum(sum.high, sum.low + lows.low);
}

constexpr DoubleDouble operator-(const DoubleDouble& a, const DoubleDouble& b) {
  return a + (-b);
}

inline DoubleDouble operator*(const DoubleDouble& a, double b) {
  const DoubleDouble product = two_product(a.high, b);
  return quick_two_sum(product.high, std::fma(a.low, b, product.low));
}

inline DoubleDouble operator*(const DoubleDouble& a, const DoubleDouble& b) {
  const DoubleDouble product = two_product(a.high, b.high);
  const double cross = std::fma(a.high, b.low, std::fma(a.low, b.high, a.low * b.low));
  return quick_two_sum(product.high, product.low + cross);
}

constexpr DoubleDouble& operator+=(DoubleDouble& a, const DoubleDouble& b) {
  return a = a + b;
}
constexpr DoubleDouble& operator+=(DoubleDouble& a, double b) {
  return a = a + b;
}
/// A sum of products, each exact and added with about 32 digits:
///     DotAccumulator sum;  sum.add(a1, b1);  sum.add(a2, b2);  sum.value()
class DotAccumulator {
 public:
  void add(double a, double b) { sum_ += two_product(a, b); }
  void add(const DoubleDouble& a, double b) { sum_ += a * b; }
  void add(const DoubleDouble& a, const DoubleDouble& b) { sum_ += a * b; }
  DoubleDouble value() const { return sum_; }

 private:
  DoubleDouble sum_;
};

}  // namespace dashpot::analysis
