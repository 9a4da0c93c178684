// Damping where a ratio has no springs to design it for, or none yet.
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

namespace dashpot::controller {
namespace {

TEST(RestartedSprings, HaveTheirRatioFromTheBeginning) {
  const RobotModel model = testing::smooth_panda();
  Settings settings = testing::plain_settings(model, Mode::kCartesian);
  settings.initial.gains.null_stiffness.setConstant(20);
  settings.initial.gains.null_damping_ratio = 0.7;
  testing::LedArm arm(model, settings);
  for (int k = 0; k < 50; ++k) ASSERT_LE(arm.tick(), Status::kTorqueLimited);  // of 500
  const Vibration& modes = arm.modes();
  ASSERT_EQ(modes.count, 7);
  for (int i = 0; i < 7; ++i)
    EXPECT_NEAR(modes.modes[testing::at(i)].damping_ratio, 0.7, 1e-6) << i;
}

/// Springs that are taken away leave the dampers that were given beside their ratio.
TEST(ZeroStiffness, KeepsDampingWithARatio) {
  const RobotModel model = testing::smooth_panda();
  const Settings defaults = default_settings(model);
  const JointVector q = testing::panda_ready();
  const DynamicsResult there = evaluate(model, q, JointVector::Zero(7));
  PostureLoop loop(model, defaults);
  const auto damping = [&](const Gains& gains, Mode mode) -> Eigen::MatrixXd {
    analysis::System<kMaxJoints> system;
    EXPECT_EQ(loop.closed_loop(q, gains, mode, system), Status::kOk);
    return system.damping;
  };
  Gains gains = defaults.initial.gains;
  gains.joint_stiffness.setZero();
  EXPECT_TRUE(testing::near(damping(gains, Mode::kJoint), gains.joint_damping, 1e-12));
  EXPECT_GT(gains.joint_damping.diagonal().minCoeff(), 0);
  // One joint without a spring has its damper, and the others keep their ratio.
  gains = defaults.initial.gains;
  const Eigen::MatrixXd with = damping(gains, Mode::kJoint);
  gains.joint_stiffness(6, 6) = 0;
  const Eigen::MatrixXd without = damping(gains, Mode::kJoint);
  EXPECT_NEAR(without(6, 6), gains.joint_damping(6, 6), 1e-12);
  EXPECT_EQ(without(6, 0), 0);
  EXPECT_LT((without - with).topLeftCorner(6, 6).norm(), 0.05 * with.norm());
  gains = defaults.initial.gains;
  gains.task_stiffness.setZero();
  gains.null_stiffness.setZero();
  gains.null_damping.setZero();
  const Eigen::MatrixXd J = there.J, C_C = gains.task_damping;
  EXPECT_TRUE(testing::near(damping(gains, Mode::kCartesian),
                            Eigen::MatrixXd(J.transpose() * C_C * J), 1e-9));
  EXPECT_GT(C_C.diagonal().minCoeff(), 0);
  gains.null_damping = defaults.initial.gains.null_damping;
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(damping(gains, Mode::kCartesian))
                .eigenvalues()
                .minCoeff(),
            1e-3);
}

}  // namespace
}  // namespace dashpot::controller
