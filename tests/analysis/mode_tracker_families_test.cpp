// Every family of hard paths, for a few of its members; tests/stress/tracker.cpp follows
// them by the hundred, and knows the truth to 50 digits.
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <memory>

namespace dashpot::analysis {
namespace {

using testing::Dice;
using testing::judge;
using testing::PathFamily;
using testing::SystemPath;
using testing::Verdict;

class TrackedFamily : public ::testing::TestWithParam<PathFamily> {};
INSTANTIATE_TEST_SUITE_P(Hard, TrackedFamily, ::testing::ValuesIn(testing::path_families()),
                         [](const auto& family) {
                           std::string name = family.param.name;
                           name.erase(std::remove(name.begin(), name.end(), ' '), name.end());
                           return name;
                         });

TEST_P(TrackedFamily, IsEnclosedAtEveryStep) {
  constexpr int kSteps = 60;
  // Coefficients graded over 8 orders of magnitude leave long double 12 digits less.
  const double accuracy = GetParam().name == "graded" ? 1e-7 : 1e-17;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Dice dice(seed);
    const SystemPath path = GetParam().make(dice);
    testing::Tracked tracked;
    for (int step = 0; step < kSteps; ++step) {
      const System<kMaxDof> system = path(static_cast<double>(step) / (kSteps - 1));
      const Status status = tracked.update(system);
      ASSERT_TRUE(status == Status::kOk || status == Status::kUncertified) << to_text(status);
      const Verdict verdict = judge<long double>(system, *tracked.spectrum, accuracy);
      ASSERT_TRUE(verdict.enclosed)
          << "step " << step << ": " << verdict.what << ", error / bound " << verdict.tightest;
      // Listed by falling frequency, each once.
      const auto first = tracked.spectrum->order.begin();
      const int count = tracked.spectrum->mode_count;
      const auto size = [&](int i) {
        const auto& values = tracked.mode(i).eigenvalues;
        return std::sqrt(std::abs(values[0]) * std::abs(values[1]));
      };
      for (int k = 1; k < count; ++k) EXPECT_LE(size(first[k]), size(first[k - 1]) * (1 + 1e-6));
      for (int k = 0; k < count; ++k) EXPECT_EQ(std::count(first, first + count, k), 1);
    }
    const TrackerCounters& counters = tracked.counters();
    EXPECT_EQ(counters.tracked + counters.reused + counters.direct, kSteps);
  }
}

/// The check itself sees what is wrong.
TEST(Enclosure, FindsBoundsThatAreTooSmall) {
  System<kMaxDof> system(2);
  system.stiffness.diagonal() << 4, 9;
  system.damping.diagonal() << 0.1, 0.2;
  testing::Tracked tracked;
  ASSERT_EQ(tracked.update(system), Status::kOk);
  const TrackedSpectrum good = *tracked.spectrum;
  EXPECT_TRUE(judge<long double>(system, good, 0).enclosed);
  const auto broken = [&](const auto& change) {
    const auto bad = std::make_unique<TrackedSpectrum>(good);
    change(bad->modes[0]);
    return !judge<long double>(system, *bad, 0).enclosed;
  };
  EXPECT_TRUE(broken([](ModeNumbers& mode) { mode.eigenvalues[0] += 1e-10; }));
  EXPECT_TRUE(broken([](ModeNumbers& mode) { mode.natural_frequency += 1e-10; }));
  EXPECT_TRUE(broken([](ModeNumbers& mode) { mode.damping_ratio += 1e-10; }));
  EXPECT_TRUE(broken([&](ModeNumbers& mode) { mode = good.modes[1]; }));
}

}  // namespace
}  // namespace dashpot::analysis
