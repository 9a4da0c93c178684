// Which gains are judged again, and which are known to be good.
#include <dashpot/controller/plugin/plugin_judgement.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/constant_damping.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

namespace dashpot::controller {
namespace {

/// Two links, with a damper in the shoulder that the loop bears the better the more the elbow is
/// bent, up to a right angle.
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
    return judgement->enough(judgement->judge(gains(damper), at(elbow), again));
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

TEST_F(Judging, AcceptsAllWhereNoMarginIsWanted) {
  settings.limits.gain_margin = 1;
  make();
  EXPECT_TRUE(accepts(1e6, 1.5, true));
}

}  // namespace
}  // namespace dashpot::controller
