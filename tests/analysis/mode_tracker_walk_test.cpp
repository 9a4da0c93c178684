// Random walks through the systems of 1 to 16 coordinates: every bound encloses the truth.
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <memory>
#include <vector>

namespace dashpot::analysis {
namespace {

struct Size {
  int joints, rows;
};
void PrintTo(const Size& size, std::ostream* out) {
  *out << size.joints << " joints, " << size.rows << " rows";
}

class RandomWalk : public ::testing::TestWithParam<Size> {};
INSTANTIATE_TEST_SUITE_P(Sizes, RandomWalk,
                         ::testing::ValuesIn(std::vector<Size>{
                             {1, 1},   {1, 0},  {2, 2},   {2, 1},  {3, 0},  {3, 2},  {4, 3},
                             {5, 5},   {5, 0},  {6, 6},   {7, 6},  {7, 5},  {7, 0},  {7, 3},
                             {8, 6},   {9, 6},  {10, 10}, {11, 0}, {12, 6}, {13, 6}, {14, 3},
                             {15, 12}, {16, 6}, {16, 0},  {16, 16}}),
                         [](const auto& size) {
                           return "Joints" + std::to_string(size.param.joints) + "Rows" +
                                  std::to_string(size.param.rows);
                         });

TEST_P(RandomWalk, IsFollowedWithinItsBounds) {
  const auto [n, rows] = GetParam();
  testing::Dice dice(2000 + 100U * static_cast<unsigned>(n) + static_cast<unsigned>(rows));
  testing::Follower follower;
  const int steps = n <= 7 ? 500 : 200, apart = n <= 7 ? 10 : 25;
  for (int walk = 0; walk < 3; ++walk) {
    follower.follow(testing::wandering_of(n, rows, dice), steps, 1e-3 * steps, apart);
    ASSERT_EQ(follower.spectrum->mode_count, rows > 0 ? rows : n);
  }
  // Followed, not solved directly; and the bounds are worth something.
  EXPECT_GE(follower.counters().tracked, 0.97 * 3 * steps);
  EXPECT_LE(follower.widest, 1e-3);
}

/// The check itself sees what is wrong.
TEST(Enclosure, FindsBoundsThatAreTooSmall) {
  System<kMaxDof> system(2);
  system.stiffness.diagonal() << 4, 9;
  system.damping.diagonal() << 0.1, 0.2;
  testing::Tracked tracked;
  ASSERT_EQ(tracked.update(system), Status::kOk);
  const TrackedSpectrum good = *tracked.spectrum;
  EXPECT_TRUE(testing::judge(system, good, 0).enclosed);
  const auto broken = [&](const auto& change) {
    const auto bad = std::make_unique<TrackedSpectrum>(good);
    change(bad->modes[0]);
    return !testing::judge(system, *bad, 0).enclosed;
  };
  EXPECT_TRUE(broken([](ModeNumbers& mode) { mode.eigenvalues[0] += 1e-10; }));
  EXPECT_TRUE(broken([](ModeNumbers& mode) { mode.natural_frequency += 1e-10; }));
  EXPECT_TRUE(broken([](ModeNumbers& mode) { mode.damping_ratio += 1e-10; }));
  EXPECT_TRUE(broken([&](ModeNumbers& mode) { mode = good.modes[1]; }));
}

}  // namespace
}  // namespace dashpot::analysis
