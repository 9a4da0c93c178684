// The maps of apps/plots/trends.gp.
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/scratch.hpp>

#include <gmock/gmock.h>

#include <cstdlib>

namespace dashpot::tests {
namespace {

TEST(Trends, ShowNoSignBeforeZero) {
  if (std::system("command -v gnuplot >/dev/null") != 0) GTEST_SKIP() << "there is no gnuplot";
  const Scratch scratch;
  std::string row;
  for (int i = 0; i < 8; ++i) row += i == 0 ? "-0.004" : i == 1 ? " -0.006" : " 0.25";
  std::string rows;
  for (int i = 0; i < 6; ++i) rows += row + "\n";
  for (const char* name : {"damping", "stiffness", "inertia"}) {
    scratch.write(std::string("trends_") + name + ".txt", rows);
  }
  const std::string line = "gnuplot -e \"dir='" + scratch.path("") + "'\" " +
                           DASHPOT_SOURCE_DIR "/apps/plots/trends.gp >" + scratch.path("out") +
                           " 2>&1";
  ASSERT_EQ(std::system(line.c_str()), 0) << scratch.read("out");
  const std::string drawn = scratch.read("trends.svg");
  EXPECT_THAT(drawn, ::testing::HasSubstr("-0.01"));
  EXPECT_THAT(drawn, ::testing::HasSubstr("0.25"));
  EXPECT_THAT(drawn, ::testing::Not(::testing::HasSubstr("-0.00")));
}

}  // namespace
}  // namespace dashpot::tests
