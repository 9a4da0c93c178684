// Arms with elastic joints: modes and margin that the analysis of the sampled loop predicts, beside
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
  testing::ElasticDifferences all;
  constexpr int kLoops = 24;
  for (std::uint64_t seed = 1; seed <= kLoops; ++seed) {
    const testing::ElasticDifference seen = testing::DrawnElasticLoop(seed).compare();
    EXPECT_TRUE(seen.agrees()) << "seed " << seed << ": " << seen;
    all.add(seen);
  }
  all.print();
  EXPECT_GT(all.worst.modes, 5 * kLoops);
  EXPECT_GT(all.bounded, kLoops / 2);
  EXPECT_GT(all.unstable, 0);
  EXPECT_LT(all.unstable, kLoops);
}

}  // namespace
}  // namespace dashpot
