// Sine and cosine in lanes against the C library in extended precision.
#include <dashpot/controller/base/sin_cos.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

using testing::kInfinity;
using testing::Random;

/// Distance of `computed` from `exact` in units in the last place of a double.
double ulps(double computed, long double exact) {
  const double rounded = std::abs(static_cast<double>(exact));
  const double unit = std::nextafter(rounded, std::numeric_limits<double>::infinity()) - rounded;
  return static_cast<double>(std::abs(static_cast<long double>(computed) - exact) /
                             static_cast<long double>(unit));
}

/// The worst of sine and cosine, each of four angles in its own lane.
double error(const Vec4d& angles) {
  Vec4d sine, cosine;
  sin_cos(angles, sine, cosine);
  double worst = 0;
  for (int i = 0; i < 4; ++i) {
    const auto angle = static_cast<long double>(angles[i]);
    worst = std::max({worst, ulps(sine[i], std::sin(angle)), ulps(cosine[i], std::cos(angle))});
  }
  return worst;
}

TEST(SinCos, AreExactToTwoUnitsInTheLastPlace) {
  Random random(701);
  double worst = 0;
  for (int i = 0; i < 60000; ++i) {
    const double size = random.log_uniform(1e-8, 9e5);
    Vec4d angles;
    for (int k = 0; k < 4; ++k) angles[k] = random.uniform(-size, size);
    worst = std::max(worst, error(angles));
  }
  for (int k = -5000; k <= 5000; k += k < -100 || k > 100 ? 7 : 1) {  // next to quarter turns
    double angle = static_cast<double>(k * 1.57079632679489661923132169163975144L);
    for (int step = 0; step < 4; ++step) {
      worst = std::max(worst, error(Vec4d{angle, -angle, angle + 1e-9, 0.5 * angle}));
      angle = std::nextafter(angle, 1e9);
    }
  }
  EXPECT_LT(worst, 2);
  Vec4d sine, cosine;
  sin_cos(Vec4d{0.0, -0.0, 0.0, 0.0}, sine, cosine);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(sine[i], 0);
    EXPECT_EQ(cosine[i], 1);
  }
}

TEST(SinCos, OfHugeAnglesAreThoseOfTheLibraryAndNeighboursDoNotCare) {
  const Vec4d angles = {1e7, 0.5, -1e300, 1e6};
  EXPECT_LT(error(angles), 2);
  Vec4d sine, cosine;
  sin_cos(Vec4d{kInfinity, 0.5, -kInfinity, std::nan("")}, sine, cosine);
  for (const int i : {0, 2, 3}) {
    EXPECT_TRUE(std::isnan(sine[i])) << i;
    EXPECT_TRUE(std::isnan(cosine[i])) << i;
  }
  EXPECT_NEAR(sine[1], std::sin(0.5), 1e-15);
  EXPECT_NEAR(cosine[1], std::cos(0.5), 1e-15);
}

}  // namespace
}  // namespace dashpot::controller
