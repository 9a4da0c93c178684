// One damping for many configurations whose loops are sampled.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random_arms.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::path_of_configurations;
using testing::Random;

std::vector<TaskImpedance> masses(const std::vector<double>& all, double stiffness) {
  std::vector<TaskImpedance> result;
  for (const double mass : all) {
    TaskImpedance one;
    one.mass = MatrixXd::Constant(1, 1, mass);
    one.stiffness = MatrixXd::Constant(1, 1, stiffness);
    result.push_back(one);
  }
  return result;
}

RegionOptions options_for(double ratio, const SampledLoop& loop) {
  RegionOptions options;
  options.target = DampingTarget::constant(ratio);
  options.loop = [loop](std::size_t) { return loop; };
  return options;
}

double margin_of(const TaskImpedance& arm, const MatrixXd& damping, const SampledLoop& loop) {
  const System<> system = to_joint_space(with_damping(arm, damping));
  return gain_margin(system, analyze(system), loop);
}

SampledLoop loop_of(double period, int delay) {
  SampledLoop loop;
  loop.period = period;
  loop.delay = delay;
  return loop;
}

/// A held force on a mass m: stable for g c < 2 m / T, if springs are weak.
TEST(RegionForALoop, LowersTheDampingToWhatTheLightestMassBears) {
  const std::vector<TaskImpedance> region = masses({4, 1, 9}, 100);
  RegionOptions options = options_for(1, loop_of(0.02, 0));
  options.gain_margin = 5;
  const RegionDesign design = design_region(region, options);
  const double borne = 2 * 1 / 0.02 / 5;
  EXPECT_NEAR(design.damping(0, 0), borne, 2e-6 * borne);
  options.loop = {};
  EXPECT_NEAR(design.share, borne / design_region(region, options).damping(0, 0), 2e-6);
  EXPECT_TRUE(design.kept);
  EXPECT_NEAR(design.gain_margin, 5, 1e-5);
  EXPECT_GE(design.gain_margin, 5);
  EXPECT_EQ(design.margin_sample, 1);
  ASSERT_EQ(design.samples.size(), 3U);
  EXPECT_NEAR(design.samples[0].gain_margin, 20, 1e-4);
  EXPECT_NEAR(design.samples[2].gain_margin, 45, 1e-3);
  EXPECT_NEAR(design.level, borne / 2 / 10 / 3, 1e-6);  // of the heaviest: c / (2 sqrt(k m))
}

/// More of them lose their margin than can join at a time.
TEST(RegionForALoop, FindsTheOneOfManyThatBearsLeast) {
  Random random(7322);
  std::vector<double> all;
  for (int i = 0; i < 60; ++i) all.push_back(random.uniform(2, 3));
  const RegionOptions options = options_for(3, loop_of(0.02, 0));
  const RegionDesign design = design_region(masses(all, 100), options);
  const auto lightest = std::min_element(all.begin(), all.end());
  const double borne = 2 * *lightest / 0.02 / 2;
  EXPECT_NEAR(design.damping(0, 0), borne, 3e-6 * borne);
  EXPECT_EQ(design.margin_sample, lightest - all.begin());
}

TEST(RegionForALoop, JudgesAGivenMatrix) {
  const std::vector<TaskImpedance> region = masses({4, 1, 9}, 100);
  const RegionOptions options = options_for(1, loop_of(0.02, 0));
  const RegionDesign kept = evaluate_region(region, MatrixXd::Constant(1, 1, 49), options);
  EXPECT_TRUE(kept.kept);
  EXPECT_NEAR(kept.gain_margin, 100. / 49, 1e-5);
  EXPECT_FALSE(evaluate_region(region, MatrixXd::Constant(1, 1, 51), options).kept);
}

TEST(RegionForALoop, LowersNothingThatTheLoopsBear) {
  const std::vector<TaskImpedance> region = masses({4, 1, 9}, 100);
  RegionOptions options = options_for(0.7, loop_of(0.001, 0));
  const RegionDesign design = design_region(region, options);
  EXPECT_EQ(design.share, 1);
  EXPECT_NEAR(design.gain_margin, 2 * 1 / 0.001 / design.damping(0, 0), 1e-3);
  options.loop = {};
  EXPECT_EQ(design.damping, design_region(region, options).damping);
}

TEST(RegionForALoop, KeepsTheMarginOfEveryArmAndNoMoreDampingWould) {
  Random random(7320);
  std::vector<TaskImpedance> region = path_of_configurations(random, 20);
  region[13].mass *= 0.5;
  for (const double cutoff : {0., 300.}) {
    SCOPED_TRACE(cutoff);
    SampledLoop loop = loop_of(cutoff > 0 ? 0.004 : 0.006, 0);
    loop.torque_cutoff = cutoff;
    RegionOptions options = options_for(0.7, loop);
    std::vector<double> told;
    options.progress = [&told](double done) { told.push_back(done); };
    const RegionDesign design = design_region(region, options);
    EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
    EXPECT_EQ(told.back(), 1);
    ASSERT_TRUE(design.kept);
    EXPECT_LT(design.share, 1);
    double least = 1e9, more = 1e9;
    for (std::size_t i = 0; i < region.size(); ++i) {
      const double margin = margin_of(region[i], design.damping, loop);
      EXPECT_NEAR(margin, design.samples[i].gain_margin, 1e-5 * margin);
      least = std::min(least, margin);
      more = std::min(more, margin_of(region[i], 1.0001 * design.damping, loop));
    }
    EXPECT_GE(least, 2 - 1e-6);
    EXPECT_LT(more, 2);
  }
}

/// In parts, the last one first, with and without a loop.
TEST(RegionDesign, IsTheSameWhereverConfigurationsAreJudged) {
  DASHPOT_SKIP_IF_QUICK();
  Random random(7321);
  std::vector<TaskImpedance> region = path_of_configurations(random, 40);
  region[31].mass *= 2.5;
  RegionOptions options;
  options.target = DampingTarget::constant(0.7);
  options.structure = DampingStructure::kDiagonal;
  for (const bool looped : {false, true}) {
    SCOPED_TRACE(looped);
    if (looped) {
      options.loop = options_for(0.7, loop_of(0.006, 0)).loop;
      region.resize(12);
    }
    const RegionDesign design = design_region(region, options);
    RegionSource source;
    source.count = region.size();
    std::size_t fetched = 0;
    source.configuration = [&](std::size_t i) {
      ++fetched;
      return region[i];
    };
    source.judge = [&](const RegionQuestion& question) {
      RegionVerdict verdict;
      for (std::size_t last = region.size(); last > 0;) {
        const std::size_t first = last > 9 ? last - 9 : 0;
        const auto at = [&](std::size_t i) {
          return region.begin() + static_cast<std::ptrdiff_t>(i);
        };
        verdict.add(judge_region({at(first), at(last)}, first, question, options.loop));
        last = first;
      }
      EXPECT_LE(verdict.binding.size(), 8U);
      return verdict;
    };
    const RegionDesign parts = design_region(source, options);
    EXPECT_EQ(parts.damping, design.damping);
    EXPECT_EQ(parts.level, design.level);
    EXPECT_EQ(parts.violation, design.violation);
    EXPECT_EQ(parts.worst_sample, design.worst_sample);
    if (looped) {
      EXPECT_LT(design.share, 1);
      EXPECT_EQ(parts.share, design.share);
      EXPECT_EQ(parts.gain_margin, design.gain_margin);
      EXPECT_EQ(parts.margin_sample, design.margin_sample);
    } else {
      EXPECT_LT(fetched, region.size());
    }
  }
}

TEST(RegionForALoop, SaysWhereNoShareKeepsTheMargin) {
  // k T^2 / m = 4: springs alone are too much for the second mass.
  const RegionOptions options = options_for(0.7, loop_of(0.02, 0));
  const RegionDesign design = design_region(masses({4, 0.01}, 100), options);
  EXPECT_FALSE(design.kept);
  EXPECT_LT(design.gain_margin, 2);
  EXPECT_EQ(design.margin_sample, 1);
}

TEST(RegionForALoop, RefusesAMarginThatIsNone) {
  RegionOptions options = options_for(0.7, loop_of(0.02, 0));
  options.gain_margin = 0.9;
  EXPECT_THROW(design_region(masses({4}, 100), options), std::invalid_argument);
  options.gain_margin = 2;
  EXPECT_THROW(judge_region(masses({4}, 100), 0, {MatrixXd::Identity(1, 1), {}, 0, 0, {}, 2}),
               std::invalid_argument);
  options.loop = [](std::size_t) { return loop_of(-1, 0); };
  EXPECT_THROW(design_region(masses({4}, 100), options), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::analysis
