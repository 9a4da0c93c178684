// Arms whose gears bend: modes and margin that the analysis of the sampled loop predicts, beside
// the simulated arm under the real controller. dashpot_stress elastic modes draws hundreds of
// loops.
#include <dashpot/tests/support/elastic_prediction.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <cstdio>

namespace dashpot {
namespace {

TEST(ElasticPrediction, IsWhatTheSimulatedLoopDoes) {
  DASHPOT_SKIP_IF_QUICK();
  testing::ElasticDifference worst;
  int bounded = 0, unstable = 0, links = 0;
  constexpr int kLoops = 24;
  for (std::uint64_t seed = 1; seed <= kLoops; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    testing::DrawnElasticLoop loop(seed);
    const testing::ElasticDifference seen = loop.compare();
    ASSERT_EQ(seen.status, controller::Status::kOk) << to_text(seen.status);
    EXPECT_LT(seen.frequency, 1e-4);
    EXPECT_LT(seen.ratio, 1e-3);
    EXPECT_LT(seen.margin, 1e-3);
    worst.frequency = std::max(worst.frequency, seen.frequency);
    worst.ratio = std::max(worst.ratio, seen.ratio);
    worst.margin = std::max(worst.margin, seen.margin);
    worst.modes += seen.modes;
    bounded += seen.bounded ? 1 : 0;
    unstable += seen.stable ? 0 : 1;
    links += loop.link() ? 1 : 0;
  }
  std::printf(
      "%d modes of %d loops, %d measured at the link, %d unstable: frequency within %.1e, ratio "
      "within %.1e, %d margins within %.1e\n",
      worst.modes, kLoops, links, unstable, worst.frequency, worst.ratio, bounded, worst.margin);
  EXPECT_GT(worst.modes, 5 * kLoops);
  EXPECT_GT(bounded, kLoops / 2);
  EXPECT_GT(unstable, 0);
  EXPECT_LT(unstable, kLoops);
}

}  // namespace
}  // namespace dashpot
