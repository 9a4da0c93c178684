// Which gains are judged again, and which are known to be good.
#include <dashpot/controller/plugin/hosted_controller.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/constant_damping.hpp>
#include <dashpot/tests/support/count_allocations.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <new>
#include <optional>

namespace dashpot::controller {
namespace {

/// Two links with a damper in the shoulder. The loop tolerates the damper better the more the elbow
/// is bent, up to a right angle.
class Judging : public ::testing::Test {
 protected:
  Judging()
      : model(testing::chain_of({"continuous", "continuous"})),
        settings(testing::constant_damping(model)) {}
  void make() { judgement.emplace(model, settings); }
  static JointVector at(double elbow) { return JointVector(Eigen::Vector2d(0.3, elbow)); }
  Gains gains(double damper) const {
    Gains gains = settings.initial.gains;
    gains.joint_damping(0, 0) = damper;
    return gains;
  }
  bool accepts(double damper, double elbow, bool again = false) {
    if (again) return judgement->enough(judgement->judge(gains(damper), at(elbow)));
    const Gains same = gains(damper);
    return judgement->change(same, same, at(elbow), judgement->attached()).taken;
  }
  /// The largest damper with enough of a margin with this elbow.
  double most(double elbow) {
    double low = 1, high = 1e5;
    while (high > 1.001 * low) {
      const double middle = std::sqrt(low * high);
      (accepts(middle, elbow, true) ? low : high) = middle;
    }
    return low;
  }

  RobotModel model;
  Settings settings;
  std::optional<Judgement> judgement;
};

TEST_F(Judging, KnowsGainsNextToWhereItAcceptedThemLast) {
  make();
  const double some = most(0.8);
  ASSERT_GT(some, 1.01 * most(0.7));
  const double damper = std::sqrt(some * most(0.78));  // too much below 0.78 rad
  make();
  EXPECT_FALSE(accepts(damper, 0.73));  // nothing is known
  EXPECT_TRUE(accepts(damper, 0.8));
  EXPECT_TRUE(accepts(damper, 0.73));         // known ...
  EXPECT_FALSE(accepts(damper, 0.73, true));  // ... but not good
  EXPECT_FALSE(accepts(damper, 0.695));       // 0.1 rad from where it was judged, not from 0.73
  EXPECT_TRUE(accepts(damper, 0.705));
  EXPECT_FALSE(accepts(1.01 * some, 0.8));  // others,
  EXPECT_TRUE(accepts(damper, 0.705));      // which are not remembered
  EXPECT_TRUE(accepts(damper, 1.1));        // judged, and there it was accepted last,
  EXPECT_FALSE(accepts(damper, 0.705));     // so that this is far
}

/// After the arm has moved to a posture with less margin than limits.gain_margin.
TEST_F(Judging, TakesWhatIsBetterThanWhatIs) {
  make();
  const double damper = 1.2 * most(0.8);
  const Attachment nothing = judgement->attached();
  const Attachment body({0.1, {0.2, 0, 0}, Eigen::Matrix3d::Zero()}, nothing.tool);
  const auto change = [&](double before, double wanted, const Attachment& attachment) {
    return judgement->change(gains(before), gains(wanted), at(0.8), attachment);
  };
  Judgement::Change found = change(damper, 0.95 * damper, nothing);
  EXPECT_TRUE(found.taken);
  EXPECT_FALSE(judgement->enough(found.verdict));
  EXPECT_GT(found.verdict.margin, found.before);
  EXPECT_FALSE(change(damper, damper, nothing).taken);
  EXPECT_FALSE(change(damper, 1.05 * damper, nothing).taken);
  // A payload that raises the margin,
  found = change(damper, damper, body);
  EXPECT_TRUE(found.taken);
  EXPECT_GT(found.verdict.margin, found.before);
  EXPECT_EQ(judgement->attached(), body);
  // and is put down again: without it these gains have too little margin, other gains have enough.
  EXPECT_FALSE(change(damper, damper, nothing).taken);
  EXPECT_EQ(judgement->attached(), body);
  found = change(damper, 0.5 * damper, nothing);
  EXPECT_TRUE(judgement->enough(found.verdict));
  EXPECT_EQ(judgement->attached(), nothing);
}

TEST_F(Judging, ForgetsABodyIfJudgingItThrows) {
  if (DASHPOT_COUNTS_ALLOCATIONS == 0) GTEST_SKIP() << "the sanitizer's own malloc";
  make();
  const Attachment nothing = judgement->attached();
  const Attachment body({1, {0.1, 0, 0}, Eigen::Matrix3d::Zero()}, nothing.tool);
  const double margin = judgement->judge(gains(1.2 * most(0.8)), at(0.8)).margin;
  const Gains same = gains(1.2 * most(0.8));
  EXPECT_THROW(testing::without_memory([&] { judgement->change(same, same, at(0.8), body); }),
               std::bad_alloc);
  EXPECT_EQ(judgement->attached(), nothing);
  EXPECT_EQ(judgement->judge(same, at(0.8)).margin, margin);
}

TEST_F(Judging, AcceptsAllWhereNoMarginIsWanted) {
  settings.limits.gain_margin = 1;
  make();
  EXPECT_TRUE(accepts(1e6, 1.5, true));
}

}  // namespace
}  // namespace dashpot::controller
