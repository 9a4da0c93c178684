// The least inertia of the tip, between limits wherever they are on the circle.
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

namespace dashpot::controller {
namespace {

using testing::kInfinity;

constexpr double kFullTurn = 2 * std::numbers::pi;

JointVector both(double a, double b) {
  JointVector result(2);
  result << a, b;
  return result;
}

class LeastInertia : public ::testing::Test {
 protected:
  /// Returns the least inertia of the tip, with the elbow between these angles.
  double of_elbow(double lower, double upper) const {
    return least_tip_inertia(model, both(-1, lower), both(1, upper)).linear;
  }
  /// Expects the same inertia of the tip as with the other limits.
  void expect_same(double lower, double upper, double other_lower, double other_upper,
                   double share = 1e-9) const {
    SCOPED_TRACE(std::to_string(lower) + " to " + std::to_string(upper));
    EXPECT_NEAR(of_elbow(lower, upper), of_elbow(other_lower, other_upper), share);
  }
  const RobotModel model = testing::chain_of({"continuous", "continuous"});
};

/// A posture a turn away is the same one; limits further apart, or none, allow a whole turn.
TEST_F(LeastInertia, IsThatOfTheRangeOnTheCircle) {
  ASSERT_GT(std::abs(of_elbow(-0.5, 0.5) - of_elbow(1, 2)), 0.01);
  for (const double turns : {-2, -1, 1, 2}) {
    const double by = turns * kFullTurn;
    expect_same(-0.5 + by, 0.5 + by, -0.5, 0.5);
    expect_same(1 + by, 2 + by, 1, 2);
  }
  ASSERT_GT(std::abs(of_elbow(-kInfinity, kInfinity) - of_elbow(1, 2)), 0.01);
  expect_same(-20, 20, -kInfinity, kInfinity);
  for (const auto& [lower, upper] :
       {std::pair(4.0, 20.0), {4.0, kInfinity}, {-20.0, -4.0}, {-kInfinity, -4.0}}) {
    expect_same(lower, upper, -kInfinity, kInfinity, 0.02);
  }
}

}  // namespace
}  // namespace dashpot::controller
