// Double-double arithmetic against exact identities and long integers.
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace dashpot::analysis {
namespace {

constexpr double kUnit = 0x1p-53;

/// high + low as a fraction of 2^-100, for numbers of order one: exact up to 2^27.
__extension__ using Wide = __int128;
Wide fixed_point(const DoubleDouble& x) {
  const auto part = [](double value) {
    return static_cast<Wide>(std::ldexp(value, 60)) * (Wide{1} << 40) +
           static_cast<Wide>(
               std::ldexp(std::ldexp(value, 60) - std::trunc(std::ldexp(value, 60)), 40));
  };
  return part(x.high) + part(x.low);
}
Wide magnitude(Wide x) {
  return x < 0 ? -x : x;
}

TEST(TwoSum, IsExactForAnyOrderOfMagnitudes) {
  EXPECT_EQ(two_sum(1.0, kUnit / 2), DoubleDouble(1.0, kUnit / 2));
  EXPECT_EQ(two_sum(kUnit / 2, 1.0), DoubleDouble(1.0, kUnit / 2));
  EXPECT_EQ(two_sum(1e20, -1e20), DoubleDouble(0.0, 0.0));
  testing::Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const double a = random.uniform(-1, 1);
    const double b = random.uniform(-1, 1) * std::ldexp(1.0, random.integer(-40, 0));
    EXPECT_EQ(fixed_point(two_sum(a, b)), fixed_point(a) + fixed_point(b));
  }
}

TEST(TwoProduct, IsExact) {
  const double a = 1 + 0x1p-30;
  EXPECT_EQ(two_product(a, a), DoubleDouble(1 + 0x1p-29, 0x1p-60));
}

TEST(DoubleDoubleProduct, KeepsThirtyDigits) {
  const DoubleDouble third(1.0 / 3, std::fma(-1.0 / 3, 3.0, 1.0) / 3);
  EXPECT_LE(std::abs((third * 3.0 - DoubleDouble(1)).high), 8 * kUnit * kUnit);
  EXPECT_LE(std::abs((third * third * 9.0 - DoubleDouble(1)).high), 16 * kUnit * kUnit);
}

TEST(DoubleDoubleSum, KeepsThirtyDigitsUnderCancellation) {
  testing::Random random(2);
  for (int i = 0; i < 1000; ++i) {
    const DoubleDouble a = two_sum(random.uniform(-1, 1), random.uniform(-1, 1) * kUnit / 4);
    const DoubleDouble b = two_sum(-a.high, random.uniform(-1, 1) * 0x1p-30);
    const Wide error = fixed_point(a + b) - fixed_point(a) - fixed_point(b);
    EXPECT_LE(magnitude(error), 4) << "in 2^-100";
  }
}

TEST(DoubleDoubleSum, TakesNegativesAndDoubles) {
  const DoubleDouble a(1.0, kUnit / 4);
  EXPECT_EQ(a - a, DoubleDouble(0));
  EXPECT_EQ(a + (-1.0), DoubleDouble(kUnit / 4));
  DoubleDouble sum = a;
  sum += a;
  EXPECT_EQ(sum, a * 2.0);
  sum = sum - a;
  EXPECT_EQ(sum, a);
}

TEST(DotAccumulator, KeepsWhatEachProductLoses) {
  DotAccumulator sum;
  sum.add(1 + 0x1p-30, 1 + 0x1p-30);
  sum.add(-1.0, 1 + 0x1p-29);
  EXPECT_EQ(sum.value(), DoubleDouble(0x1p-60));
}

TEST(DotAccumulator, FindsWhatWorkingPrecisionLoses) {
  DotAccumulator sum;
  sum.add(1e16, 1.0);
  sum.add(1.0, 1.0);
  sum.add(-1e16, 1.0);
  sum.add(DoubleDouble(0.5, kUnit / 8), 2.0);
  EXPECT_EQ(sum.value(), DoubleDouble(2.0, kUnit / 4));
}

}  // namespace
}  // namespace dashpot::analysis
