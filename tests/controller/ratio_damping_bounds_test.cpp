// Damping designed at every tick is semidefinite and bounded, whatever it is designed for.
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

using testing::LedArm;
using testing::plain_settings;
using testing::smooth_panda;

TEST(DesignedDamping, IsSemidefiniteWhateverChanges) {
  const RobotModel model = smooth_panda();
  LedArm led(model, plain_settings(model, Mode::kCartesian));
  testing::Random random(20210606);
  Gains& gains = led.setpoint.gains;
  double smallest = 0, largest = 0;
  for (int k = 0; k < 20'000; ++k) {
    if (k % 150 == 0) {
      const Eigen::Index rank = 1 + k / 150 % 6;
      const Eigen::MatrixXd root = 20 * random.matrix(6, rank);
      gains.task_stiffness = root * root.transpose();
      gains.task_damping_ratio = k / 150 % 4 == 0 ? 0 : 0.35 * static_cast<double>(rank) - 0.3;
      gains.frame = k / 450 % 2 == 0 ? Frame::kBase : Frame::kTool;
      gains.directions[static_cast<std::size_t>(rank - 1)] ^= true;
      if (k / 150 % 5 == 0) led.setpoint.mode = Mode::kJoint;
      if (k / 150 % 5 == 1) led.setpoint.mode = Mode::kCartesian;
    }
    led.swing(1e-3 * k);
    ASSERT_LE(led.tick(), Status::kTorqueLimited);
    if (k % 10 != 0) continue;
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(led.damping()).eigenvalues();
    smallest = std::min(smallest, values.minCoeff() / std::max(values.maxCoeff(), 1e-9));
    largest = std::max(largest, values.maxCoeff());
  }
  EXPECT_GT(smallest, -1e-12);
  EXPECT_GT(largest, 10);
}

/// Stretched, the arm loses a direction: the damping in the joints stays what the frequencies
/// allow, and so does the torque.
TEST(DesignedDamping, IsBoundedThroughASingularity) {
  const RobotModel model = smooth_panda();
  Settings settings = plain_settings(model, Mode::kCartesian);
  LedArm led(model, settings);
  JointVector stretched = led.center;
  stretched << 0, 0, 0, 0, 0, 0.3, 0;
  led.settle();
  double least = 1, most = 0, step = 0;
  JointVector last;
  for (int k = -1500; k <= 1500; ++k) {
    const double s = 1 - std::abs(k) / 1500.0;
    led.state.position = led.center + s * (stretched - led.center);
    led.state.velocity = (k < 0 ? 1 : -1) / 1.5 * (stretched - led.center);
    if (k == 0) led.state.velocity.setZero();
    led.setpoint.tip_pose.position.x() += k % 500 < 250 ? 1e-4 : -1e-4;
    ASSERT_LE(led.tick(), Status::kTorqueLimited);
    const DynamicsResult robot = evaluate(model, led.state.position, led.state.velocity);
    const Eigen::MatrixXd M = robot.M, J = robot.J;
    least = std::min(least, Eigen::JacobiSVD<Eigen::MatrixXd>(J).singularValues()[5]);
    const Eigen::MatrixXd K = J.transpose() * settings.initial.gains.task_stiffness * J;
    const auto largest = [&](const Eigen::MatrixXd& A) {
      return Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(A, M).eigenvalues()[6];
    };
    EXPECT_LE(largest(led.damping()), 1.4 * std::sqrt(largest(K)) * (1 + 1e-6));
    const JointVector& now = led.controller.snapshot().law_torque;
    most = std::max(most, now.cwiseAbs().maxCoeff());
    // Where the velocity turns round, it jumps.
    if (k > -1500 && std::abs(k) > 1) step = std::max(step, (now - last).cwiseAbs().maxCoeff());
    last = now;
  }
  EXPECT_LT(least, 1e-6);
  EXPECT_LT(most, 2500);
  EXPECT_LT(step, 5);
}

TEST(DesignedDamping, NeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  const RobotModel model = smooth_panda();
  LedArm led(model, plain_settings(model, Mode::kCartesian));
  const Matrix6 stiffness = led.setpoint.gains.task_stiffness;
  const int count = testing::allocations_of([&] {
    for (int k = 0; k < 3000; ++k) {
      Gains& gains = led.setpoint.gains;
      if (k % 300 == 0) gains.task_stiffness = (1 + 1e-3 * k) * stiffness;
      if (k % 700 == 0) gains.task_damping_ratio = 0.7 - gains.task_damping_ratio;
      if (k % 1100 == 0) gains.frame = k % 2200 == 0 ? Frame::kTool : Frame::kBase;
      led.swing(1e-3 * k);
      led.tick();
    }
  });
  EXPECT_EQ(count, 0);
}

TEST(DesignedDamping, KeepsTheLastDesignWhereThereIsNone) {
  RatioDamper damper(6);
  damper.set(100 * Matrix6::Identity(), 0.7, {});
  JointMatrix M = Eigen::MatrixXd::Identity(7, 7), broken = M;
  Jacobian J = Eigen::MatrixXd::Identity(6, 7);
  broken(3, 3) = -1;
  damper.update(broken, &J);
  EXPECT_EQ(damper.damping(), Matrix6::Zero());
  damper.update(M, &J);
  const Matrix6 good = damper.damping();
  EXPECT_TRUE(
      testing::near(Eigen::MatrixXd(good), Eigen::MatrixXd(14 * Matrix6::Identity()), 1e-9));
  for (const double wrong : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    broken = M;
    broken(3, 3) = wrong;
    damper.update(broken, &J);
    EXPECT_EQ(damper.damping(), good);
  }
  // A stiffness that rounding has made indefinite, as far as check_gains lets it pass, is taken.
  Matrix6 flat = Vector6(100, 100, 100, 100, 100, -5e-9).asDiagonal();
  damper.set(flat, 0.35, {});
  damper.update(M, &J);
  EXPECT_NEAR(damper.damping()(0, 0), 7, 1e-6);
  EXPECT_NEAR(damper.damping()(5, 5), 0, 1e-3);
}

TEST(DesignedDamping, IsBoundedHoweverSingularTheJacobian) {
  RatioDamper damper(6);
  const double K = 2000, ratio = 0.7;
  damper.set(K * Matrix6::Identity(), ratio, {});
  double largest = 0;
  for (int k = 0; k < 200; ++k) {
    JointMatrix M = Eigen::MatrixXd::Identity(7, 7);
    Jacobian J = Eigen::MatrixXd::Identity(6, 7);
    J.row(2) *= std::pow(10, -0.1 * k);  // its frequency falls from 45 to 4e-19 rad/s
    damper.update(M, &J);
    const Matrix6& C_C = damper.damping();
    EXPECT_GE(Eigen::SelfAdjointEigenSolver<Matrix6>(C_C).eigenvalues()[0], -1e-9);
    largest = std::max(largest, C_C(2, 2));
  }
  EXPECT_LT(largest, 2.3 * ratio * K / kSoftFrequency);
  EXPECT_GT(largest, 1.9 * ratio * K / kSoftFrequency);
}

// Rounding may leave a mass matrix singular, and springs a little indefinite: both have a design.
TEST(DesignedDamping, IsDesignedForWhatRoundingMadeSingular) {
  const JointMatrix singular{{1.0, 1.0}, {1.0, 1.0}};
  JointMatrix K_q{{100.0, 100.0}, {100.0, 100.0}};
  for (const double indefinite : {0.0, -5e-9}) {
    K_q(1, 1) = 100 + indefinite;
    RatioDamper joints(2);
    joints.set(K_q, 0.7, JointVector());
    joints.update(singular, nullptr);
    const Eigen::MatrixXd C_q = joints.damping();
    ASSERT_TRUE(C_q.allFinite());
    // Along (1, 1), with mass 2 and stiffness 200 in the one direction that there is
    EXPECT_NEAR(C_q.trace(), 2 * 0.7 * std::sqrt(200.0 / 2) * 2, 0.01);
    EXPECT_TRUE(testing::near(C_q, C_q.transpose(), 0));

    Matrix6 K_C = Matrix6::Zero();
    K_C.topLeftCorner<2, 2>() = K_q;
    Jacobian J = Jacobian::Zero(6, 2);
    J.topRows<2>().setIdentity();
    RatioDamper tip(6);
    tip.set(K_C, 0.7, JointVector());
    tip.update(singular, &J);
    ASSERT_TRUE(tip.damping().allFinite());
    EXPECT_NEAR(tip.damping().trace(), 2 * 0.7 * std::sqrt(200.0 / 2) * 2, 0.01);
    tip.reset();
    EXPECT_TRUE(tip.damping().isZero(0));
    joints.reset();
    EXPECT_TRUE(joints.damping().isZero(0));
  }
}

TEST(DesignedDamping, RefusesWhatIsNoRatio) {
  const RobotModel model = smooth_panda();
  const Settings settings = plain_settings(model, Mode::kCartesian);
  for (const double wrong : {-1e-9, 2.0001, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
    Settings bad = settings;
    bad.initial.gains.task_damping_ratio = wrong;
    try {
      Controller controller(model, bad);
      FAIL() << wrong;
    } catch (const InvalidSettings& error) {
      EXPECT_EQ(error.key(), "initial.gains.task_damping_ratio");
      EXPECT_NE(std::string(error.what()).find("must be between 0 and 2"), std::string::npos);
    }
    const SetpointFault fault = check_gains(bad.initial.gains, Mode::kCartesian, 7);
    EXPECT_STREQ(fault.key, "task_damping_ratio");
    LedArm led(model, settings);
    led.settle();
    const Eigen::MatrixXd before = led.damping();
    led.setpoint.gains.task_damping_ratio = wrong;
    EXPECT_EQ(led.tick(), Status::kSetpointRejected);
    led.settle();
    EXPECT_TRUE(testing::near(led.damping(), before, 1e-9));
  }
}

}  // namespace
}  // namespace dashpot::controller
