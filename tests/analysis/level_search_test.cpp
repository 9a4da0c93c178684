// The search for the largest share of damping that a loop tolerates, with functions as margins.
#include <dashpot/analysis/design/level_search.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

/// A margin that rises to `peak` at `level`, and falls beyond it.
struct Peak {
  double level, peak, rise, fall;  ///< rise and fall: powers of the level

  double margin(double at) const { return peak * std::pow(at / level, at < level ? rise : -fall); }
};

struct Search {
  FoundLevel found;
  int questions = 0, margins = 0;

  Search(const Peak& peak, double wanted) {
    found = find_level(
        [&](double level, double least) {
          ++questions;
          return peak.margin(level) >= least;
        },
        [&](double level) {
          ++margins;
          return peak.margin(level);
        },
        wanted);
  }
};

TEST(LevelSearch, FindsTheLargestLevelFromBelow) {
  for (const double level : {2e-3, 0.01, 0.1, 0.3, 0.66, 0.9}) {
    const Search search({0.5 * level, 4, 1, 1}, 2);  // 2 at `level`
    EXPECT_TRUE(search.found.kept);
    EXPECT_LE(search.found.level, level * (1 + 1e-12));
    EXPECT_GE(search.found.level, level * (1 - 1.1e-6));
    EXPECT_EQ(search.margins, 0);
  }
  EXPECT_EQ(Search({1, 2.1, 1, 1}, 2).found.level, 1);
}

TEST(LevelSearch, FindsAPeakBetweenGridPoints) {
  for (const double level : {0.003, 0.05, 0.8, 0.95}) {
    for (const double rise : {0.5, 4.0}) {
      const Search search({level, 2.0001, rise, 1}, 2);
      EXPECT_TRUE(search.found.kept) << level;
      EXPECT_NEAR(search.found.level, level, 3e-4 * level);
    }
  }
}

TEST(LevelSearch, StaysAtFullDampingWhereNoLevelHasAMargin) {
  const Search search({1, 0, 1, 1}, 2);
  EXPECT_FALSE(search.found.kept);
  EXPECT_EQ(search.found.level, 1);
  EXPECT_EQ(search.margins, 1);
}

/// A margin that is zero but for a part of the levels.
TEST(LevelSearch, FindsALevelThatHasAMarginAtAll) {
  const auto margin = [](double level) { return level > 0.1 && level < 0.7 ? 0.5 : 0.0; };
  const FoundLevel found =
      find_level([&](double level, double least) { return margin(level) >= least; }, margin, 2);
  EXPECT_FALSE(found.kept);
  EXPECT_EQ(margin(found.level), 0.5);
}

TEST(LevelSearch, SpendsLittleOnAMarginOutOfReach) {
  for (const double level : {0.003, 0.007, 0.02, 0.05, 0.13, 0.3, 0.6, 1.0, 5.0}) {
    const Search search({level, 0.7, 4, 1}, 2);
    EXPECT_FALSE(search.found.kept);
    EXPECT_LE(search.questions, 36);  // 17 of the grid
    EXPECT_LE(search.margins, 11);    // of levels each better than those before
    EXPECT_NEAR(std::log(search.found.level), std::log(std::min(level, 1.0)), 3e-3);
  }
}

}  // namespace
}  // namespace dashpot::analysis
