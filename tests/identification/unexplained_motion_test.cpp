// What no linear model explains. Arms that rub and springs that stiffen: `./run stress identify
// rubbing` and `stiffening`.
#include <dashpot/identification/identification.hpp>
#include <dashpot/tests/support/dice.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

namespace dashpot::identification {
namespace {

/// A light mode beside a wander that no model explains: slow, of two channels for themselves.
TEST(UnexplainedMotion, BelieveNoDampedModesWhereMuchIsLeftOver) {
  int found = 0;
  for (const std::uint64_t seed : {4300U, 4301U, 4302U, 4303U, 4348U}) {
    testing::Dice draw(seed);
    MotionRecord record{Eigen::VectorXd(1500), Eigen::MatrixXd(2, 1500)};
    double a = 0, b = 0;
    for (Eigen::Index i = 0; i < 1500; ++i) {
      const double t = record.time[i] = 0.004 * static_cast<double>(i);
      const double mode = std::exp(-0.3 * t) * std::cos(18.6 * t);
      a = 0.985 * a + 0.05 * draw.normal();
      b = 0.97 * b + 0.07 * draw.normal();
      record.output(0, i) = mode + a;
      record.output(1, i) = 0.5 * mode + b;
    }
    const Identification result = identify_decays({record});
    EXPECT_LT(result.explained, 0.95) << seed;
    for (const MeasuredMode& mode : result.modes) {
      EXPECT_LT(mode.damping_ratio, 0.1) << seed << ": " << mode.natural_frequency;
      found += std::abs(mode.natural_frequency - 18.6) < 0.3;
    }
  }
  EXPECT_GE(found, 4);
}

}  // namespace
}  // namespace dashpot::identification
