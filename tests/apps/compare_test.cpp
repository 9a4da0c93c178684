// The table of apps/plots/compare.py, for a release with known numbers.
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <sstream>

namespace dashpot::tests {
namespace {

TEST(Compare, MeasuresADampedSwing) {
  const Scratch scratch;
  const double rate = 2, swing = 20;  // 1/s, rad/s
  std::string csv = "time,torque1,torque2,error_x,error_y,error_z\n";
  for (int k = 0; k <= 6000; ++k) {
    const double t = 1e-3 * k, y = std::exp(-rate * t) * std::cos(swing * t);
    std::ostringstream line;
    line.precision(17);
    line << t << ',' << 5 + 3 * y << ',' << -1 - 4 * y << ",0," << -0.02 * y << ",0\n";
    csv += line.str();
  }
  scratch.write("a.csv", csv);
  scratch.write("a.txt", "# smallest_ratio 0.0995\n0 0 0\n");
  const std::string line = "python3 " +
                           DASHPOT_SOURCE_DIR "/apps/plots/compare.py swing=" + scratch.path("a") +
                           " >" + scratch.path("out");
  ASSERT_EQ(std::system(line.c_str()), 0);
  std::istringstream out(scratch.read("out"));
  std::string skipped, name;
  std::getline(out, skipped);
  std::getline(out, skipped);
  double ratio = 0, five = 0, two = 0, overshoot = 0, torque = 0;
  out >> name >> ratio >> five >> two >> overshoot >> torque;
  EXPECT_EQ(name, "swing");
  EXPECT_EQ(ratio, 0.0995);
  // No later than the envelope, and at most half a swing before it.
  for (const auto& [time, part] : {std::pair(five, 0.05), {two, 0.02}}) {
    const double envelope = -std::log(part) / rate;
    EXPECT_LE(time, envelope + 1e-3);
    EXPECT_GE(time, envelope - 3.1416 / swing);
    for (double t = time; t < 6; t += 1e-3) {
      EXPECT_LE(std::exp(-rate * t) * std::abs(std::cos(swing * t)), part * (1 + 1e-9)) << t;
    }
  }
  EXPECT_NEAR(overshoot, 100 * std::exp(-rate * 3.1416 / swing), 0.6);  // its peak is a bit earlier
  EXPECT_NEAR(torque, 4, 1e-4);
}

}  // namespace
}  // namespace dashpot::tests
