#include <dashpot/controller/base/orientation.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <numbers>

namespace dashpot::controller {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using testing::near;
using testing::Random;
using testing::random_rotation;

constexpr double kPi = std::numbers::pi;

TEST(RotationVector, IsTheLogarithmOfTheExponential) {
  Random random(301);
  for (const double size :
       {0.0, 1e-300, 1e-20, 1e-12, 1.9e-9, 1e-5, 2e-4, 0.1, 1.0, 3.0, kPi, 5.0, 6.0}) {
    for (int k = 0; k < 50; ++k) {
      const Vector3d e = size * Vector3d(random.vector(3)).normalized();
      Quaterniond q = quaternion(e);
      EXPECT_TRUE(near(rotation_vector(q), e, size < 1e-8 ? 1e-15 * size : 2e-15 * (1 + size)));
      if (size > 0) {
        EXPECT_TRUE(near(q.coeffs(), Quaterniond(AngleAxisd(size, e / size)).coeffs(), 2e-15));
      }
      q.coeffs() = -q.coeffs();
      const Vector3d other = rotation_vector(q);
      if (size < 2e-9) {  // both quaternions give the small vector, and none a whole turn
        EXPECT_TRUE(near(other, e, 1e-15 * size));
      }
      if (q.w() > 0) {  // the shorter one
        EXPECT_LE(other.norm(), kPi + 1e-15);
      }
    }
  }
}

TEST(RotationDefect, TellsRotationsFromOtherMatrices) {
  Random random(303);
  for (int k = 0; k < 100; ++k) {
    Eigen::Matrix3d R = random_rotation(random).toRotationMatrix();
    EXPECT_LT(rotation_defect(R), 1e-14);
    EXPECT_NEAR(rotation_defect(1.001 * R), 0.002001, 1e-9);
    EXPECT_EQ(rotation_defect(-R), std::numeric_limits<double>::infinity());
    R(k % 3, k / 3 % 3) = std::nan("");
    EXPECT_EQ(rotation_defect(R), std::numeric_limits<double>::infinity());
  }
  EXPECT_EQ(rotation_defect(Eigen::Matrix3d::Zero()), std::numeric_limits<double>::infinity());
}

TEST(OrientationError, TurnsTheTipToTheGoal) {
  Random random(304);
  for (int k = 0; k < 1000; ++k) {
    OrientationError error;
    const Quaterniond goal = random_rotation(random), tip = random_rotation(random);
    const Vector3d e = error.update(goal, tip);
    EXPECT_LE(e.norm(), kPi + 1e-14);
    EXPECT_TRUE(near((quaternion(e) * tip).toRotationMatrix(), goal.toRotationMatrix(), 1e-14));
  }
}

TEST(OrientationError, IsContinuousThroughHalfATurn) {
  Random random(305);
  for (int k = 0; k < 50; ++k) {
    OrientationError error;
    const Quaterniond start = random_rotation(random);
    const Vector3d axis = Vector3d(random.vector(3)).normalized();
    Vector3d last = Vector3d::Zero();
    for (double angle = 0; angle < 1.45 * kPi; angle += 0.01) {
      Quaterniond goal = Quaterniond(AngleAxisd(angle, axis)) * start;
      if (random.integer(0, 1) == 1) goal.coeffs() = -goal.coeffs();  // the same rotation
      const Vector3d e = error.update(goal, start);
      EXPECT_NEAR(e.norm(), angle, 1e-12);
      EXPECT_LT((e - last).norm(), 0.0101);
      last = e;
    }
  }
}

TEST(OrientationError, TakesTheShortWayAfterAResetAndPastThreeQuartersOfATurn) {
  OrientationError error;
  const auto at = [&](double angle) {
    return error.update(Quaterniond(AngleAxisd(angle, Vector3d::UnitZ())), Quaterniond::Identity());
  };
  for (double angle = 0; angle < 1.2 * kPi; angle += 0.1) at(angle);
  EXPECT_NEAR(at(1.2 * kPi).z(), 1.2 * kPi, 1e-12);
  error.reset();
  EXPECT_NEAR(at(1.2 * kPi).z(), -0.8 * kPi, 1e-12);
  error.reset();
  double largest = 0, last = 0;
  for (double angle = 0; angle < 2 * kPi; angle += 0.01) {
    last = at(angle).z();
    largest = std::max(largest, last);
  }
  EXPECT_NEAR(largest, 1.5 * kPi, 0.02);
  EXPECT_LT(std::abs(last), 0.02);
}

}  // namespace
}  // namespace dashpot::controller
