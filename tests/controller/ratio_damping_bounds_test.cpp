// Damping designed for a ratio is bounded and semidefinite for any system.
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using testing::LedArm;
using testing::near;
using testing::plain_settings;
using testing::smooth_panda;

/// A stretched arm loses a direction: the joint damping stays as large as the frequencies allow,
/// and so does the torque.
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
    const MatrixXd M = robot.M, J = robot.J;
    least = std::min(least, Eigen::JacobiSVD<MatrixXd>(J).singularValues()[5]);
    const MatrixXd K = J.transpose() * settings.initial.gains.task_stiffness * J;
    const auto largest = [&](const MatrixXd& A) {
      return Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd>(A, M).eigenvalues()[6];
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

TEST(DesignedDamping, KeepsTheLastDesignWhereThereIsNone) {
  RatioDamper damper(6);
  damper.set(100 * Matrix6::Identity(), 0.7, {});
  JointMatrix M = MatrixXd::Identity(7, 7), broken = M;
  Jacobian J = MatrixXd::Identity(6, 7);
  broken(3, 3) = -1;
  damper.update(broken, &J);
  EXPECT_EQ(damper.damping(), Matrix6::Zero());
  damper.update(M, &J);
  const Matrix6 good = damper.damping();
  EXPECT_TRUE(near(good, 14 * Matrix6::Identity(), 1e-9));
  for (const double wrong : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    broken = M;
    broken(3, 3) = wrong;
    damper.update(broken, &J);
    EXPECT_EQ(damper.damping(), good);
  }
  // A stiffness that rounding has made indefinite, as far as check_gains accepts it, is accepted.
  Matrix6 flat = Vector6(100, 100, 100, 100, 100, -5e-9).asDiagonal();
  damper.set(flat, 0.35, {});
  damper.update(M, &J);
  EXPECT_NEAR(damper.damping()(0, 0), 7, 1e-6);
  EXPECT_NEAR(damper.damping()(5, 5), 0, 1e-3);
}

// Rounding may leave a mass matrix singular, and springs a little indefinite: both have a design.
TEST(DesignedDamping, IsDesignedForWhatRoundingMadeSingular) {
  const JointMatrix singular{{1.0, 1.0}, {1.0, 1.0}};
  JointMatrix K_q{{100.0, 100.0}, {100.0, 100.0}};
  for (const double indefinite : {0.0, -5e-9}) {
    K_q(1, 1) = 100 + indefinite;
    Matrix6 K_C = Matrix6::Zero();
    K_C.topLeftCorner<2, 2>() = K_q;
    Jacobian J = Jacobian::Zero(6, 2);
    J.topRows<2>().setIdentity();
    for (const bool tip : {false, true}) {
      RatioDamper damper(tip ? 6 : 2);
      damper.set(tip ? JointMatrix(K_C) : K_q, 0.7, JointVector());
      damper.update(singular, tip ? &J : nullptr);
      const MatrixXd C = damper.damping();
      ASSERT_TRUE(C.allFinite());
      // Along (1, 1), with mass 2 and stiffness 200 in the one direction that there is
      EXPECT_NEAR(C.trace(), 2 * 0.7 * std::sqrt(200.0 / 2) * 2, 0.01);
      EXPECT_TRUE(near(C, C.transpose(), tip ? 1e-12 : 0));
      damper.reset();
      EXPECT_TRUE(damper.damping().isZero(0));
    }
  }
}

/// Without springs, the dampers given beside their ratio act.
TEST(DesignedDamping, LeavesWhatWasGivenWhereThereIsNoStiffness) {
  const RobotModel model = testing::smooth_panda();
  const Settings defaults = default_settings(model);
  const JointVector q = testing::panda_ready();
  const DynamicsResult there = evaluate(model, q, JointVector::Zero(7));
  PostureLoop loop(model, defaults);
  const auto damping = [&](const Gains& gains, Mode mode) -> MatrixXd {
    analysis::System<kMaxJoints> system;
    EXPECT_EQ(loop.closed_loop(q, gains, mode, system), Status::kOk);
    return system.damping;
  };
  Gains gains = defaults.initial.gains;
  gains.joint_stiffness.setZero();
  EXPECT_TRUE(near(damping(gains, Mode::kJoint), gains.joint_damping, 1e-12));
  EXPECT_GT(gains.joint_damping.diagonal().minCoeff(), 0);
  // One joint without a spring has its damper, and the others keep their ratio.
  gains = defaults.initial.gains;
  const MatrixXd with = damping(gains, Mode::kJoint);
  gains.joint_stiffness(6, 6) = 0;
  const MatrixXd without = damping(gains, Mode::kJoint);
  EXPECT_NEAR(without(6, 6), gains.joint_damping(6, 6), 1e-12);
  EXPECT_EQ(without(6, 0), 0);
  EXPECT_LT((without - with).topLeftCorner(6, 6).norm(), 0.05 * with.norm());
  gains = defaults.initial.gains;
  gains.task_stiffness.setZero();
  gains.null_stiffness.setZero();
  gains.null_damping.setZero();
  const MatrixXd J = there.J, C_C = gains.task_damping;
  EXPECT_TRUE(near(damping(gains, Mode::kCartesian), MatrixXd(J.transpose() * C_C * J), 1e-9));
  EXPECT_GT(C_C.diagonal().minCoeff(), 0);
  gains.null_damping = defaults.initial.gains.null_damping;
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<MatrixXd>(damping(gains, Mode::kCartesian))
                .eigenvalues()
                .minCoeff(),
            1e-3);
}

}  // namespace
}  // namespace dashpot::controller
