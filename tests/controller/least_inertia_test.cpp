// The inertia that joints have at least, between limits wherever they are on the circle.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/model/least_inertia.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <numbers>
#include <string>

namespace dashpot::controller {
namespace {

using testing::kInfinity;
using testing::near;

constexpr double kFullTurn = 2 * std::numbers::pi;

JointVector both(double a, double b) {
  JointVector result(2);
  result << a, b;
  return result;
}

class LeastInertia : public ::testing::Test {
 protected:
  /// Of both joints, with the elbow between these angles.
  JointVector of_elbow(double lower, double upper) const {
    return least_joint_inertia(model, both(-1, lower), both(1, upper));
  }
  /// Expects joints and tip to have what they have with the other limits.
  void expect_same(double lower, double upper, double other_lower, double other_upper,
                   double share = 1e-9) const {
    SCOPED_TRACE(std::to_string(lower) + " to " + std::to_string(upper));
    const JointVector other = of_elbow(other_lower, other_upper);
    EXPECT_TRUE(near(of_elbow(lower, upper), other, share * other.maxCoeff()));
    const auto tip = [&](double low, double high) {
      return least_tip_inertia(model, both(-1, low), both(1, high)).linear;
    };
    EXPECT_NEAR(tip(lower, upper), tip(other_lower, other_upper), share);
  }
  const RobotModel model = testing::chain_of({"continuous", "continuous"});
};

/// A posture a turn away is the same one; more than a turn is a turn, and so is no limit.
TEST_F(LeastInertia, IsThatOfTheRangeOnTheCircle) {
  ASSERT_GT((of_elbow(-0.5, 0.5) - of_elbow(1, 2)).norm(), 0.01);
  for (const double turns : {-2, -1, 1, 2}) {
    const double by = turns * kFullTurn;
    expect_same(-0.5 + by, 0.5 + by, -0.5, 0.5);
    expect_same(1 + by, 2 + by, 1, 2);
  }
  ASSERT_GT((of_elbow(-kInfinity, kInfinity) - of_elbow(1, 2)).norm(), 0.01);
  expect_same(-20, 20, -kInfinity, kInfinity);
  for (const auto& [lower, upper] :
       {std::pair(4.0, 20.0), {4.0, kInfinity}, {-20.0, -4.0}, {-kInfinity, -4.0}}) {
    expect_same(lower, upper, -kInfinity, kInfinity, 0.02);
  }
}

/// M^-1 diag(I) has no eigenvalue above 1 at the postures that were looked at, and hardly one
/// elsewhere: dampers in proportion to I are borne wherever the arm is.
TEST(LeastJointInertia, HoldsWhereverAnArmIs) {
  testing::Random random(2026);
  for (const testing::Arm& arm : testing::arms()) {
    const RobotModel model = testing::arm_model(arm);
    const JointVector lower = model.joint_values(&Joint::lower),
                      upper = model.joint_values(&Joint::upper);
    const Eigen::VectorXd root = least_joint_inertia(model, lower, upper).cwiseSqrt();
    double largest = 0;
    for (int k = 0; k < 2500; ++k) {
      JointVector q(model.dof());
      for (int i = 0; i < model.dof(); ++i) {
        q[i] = random.uniform(std::max(lower[i], -std::numbers::pi),
                              std::min(upper[i], std::numbers::pi));
      }
      const Eigen::MatrixXd M = evaluate(model, q, JointVector::Zero(model.dof())).M;
      const Eigen::MatrixXd A =
          root.asDiagonal() * M.llt().solve(Eigen::MatrixXd(root.asDiagonal()));
      largest = std::max(
          largest,
          Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A).eigenvalues()[model.dof() - 1]);
    }
    RecordProperty(arm.file, std::to_string(largest));
    EXPECT_LE(largest, 1.1) << arm.file;
    EXPECT_GE(largest, 0.9) << arm.file;  // and is no smaller than it has to be
  }
}

}  // namespace
}  // namespace dashpot::controller
