// Damping ratios held beside friction in the joints, and in the joint mode.
#include <dashpot/controller/law/designed_damping.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/led_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>

namespace dashpot::controller {
namespace {

/// An arm whose every joint has this viscous friction, N m s/rad.
RobotModel rubbing(const testing::Arm& arm, double friction) {
  ModelOptions options;
  options.viscous_friction = Eigen::VectorXd::Constant(testing::arm_model(arm).dof(), friction);
  options.reflected_inertia = Eigen::VectorXd::Constant(options.viscous_friction.size(), 0.1);
  return testing::arm_model(arm, options);
}

/// Settings that take the friction off.
Settings rubbing_settings(const RobotModel& model, Mode mode) {
  Settings settings = testing::plain_settings(model, mode);
  settings.subtract_friction = true;
  return settings;
}

/// Its gains have grown; swings are so slow that velocities do not matter.
struct Led : testing::LedArm {
  Led(const RobotModel& robot, const Settings& settings) : LedArm(robot, settings) { settle(); }
  void swing(double t) {
    LedArm::swing(t);
    state.velocity.setZero();
  }
};

/// Largest difference of a published ratio from 0.7, of modes that are not soft.
double worst_ratio(const Vibration& modes) {
  double worst = 0;
  for (int i = 0; i < modes.count; ++i) {
    const VibrationMode& mode = modes.modes[static_cast<std::size_t>(i)];
    if (mode.natural_frequency < 0.11) continue;
    worst = std::max(worst, std::abs(mode.damping_ratio - 0.7));
  }
  return worst;
}

/// Along a swing.
double worst_ratio(Led& led, int modes) {
  double worst = 0;
  for (int k = 1; k <= 300; ++k) {
    led.swing(1e-3 * k);
    EXPECT_LE(led.tick(), Status::kTorqueLimited);
    EXPECT_EQ(led.controller.vibration().count, modes);
    worst = std::max(worst, worst_ratio(led.controller.vibration()));
  }
  return worst;
}

// The friction is among what the published modes count, so that they are the judge.
TEST(RatioDampingBesideFriction, TakesOffWhatFrictionDampsAlready) {
  for (const testing::Arm& arm : testing::arms()) {
    for (const Frame frame : {Frame::kBase, Frame::kTool}) {
      const RobotModel model = rubbing(arm, 0.3);
      Settings settings = rubbing_settings(model, Mode::kCartesian);
      settings.initial.gains.frame = frame;
      Led led(model, settings);
      const bool redundant = model.dof() > 6;
      const double worst = worst_ratio(led, model.dof() - (redundant ? 1 : 0));
      std::printf("%s: ratios off by up to %.2g\n", arm.file, worst);
      EXPECT_LT(worst, redundant ? 2e-3 : 1e-6) << arm.file;
    }
  }
}

TEST(RatioDampingBesideFriction, IsSemidefiniteWhereFrictionIsTooMuch) {
  const RobotModel model = rubbing(testing::arms()[0], 30);
  Led led(model, rubbing_settings(model, Mode::kCartesian));
  for (int k = 1; k <= 50; ++k) {
    led.swing(0.01 * k);
    ASSERT_LE(led.tick(), Status::kTorqueLimited);
    const Eigen::MatrixXd designed = led.damping() - 30 * Eigen::MatrixXd::Identity(7, 7);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(designed).eigenvalues()[0], -1e-9);
  }
  EXPECT_EQ(led.controller.vibration().counters.failed, 0u);
}

TEST(DesignedInJoints, HoldsTheRatioAlongAPathOfEveryArm) {
  for (const testing::Arm& arm : testing::arms()) {
    for (const double friction : {0.0, 0.5}) {
      const RobotModel model = rubbing(arm, friction);
      Led led(model, rubbing_settings(model, Mode::kJoint));
      EXPECT_LT(worst_ratio(led, model.dof()), 1e-6) << arm.file << ", friction " << friction;
    }
  }
}

/// Springs that grow from zero have their ratio from the start.
TEST(DesignedInJoints, HoldsTheRatioWhileTheSpringsGrow) {
  const RobotModel model = rubbing(testing::arms()[0], 0);
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    Settings settings = rubbing_settings(model, mode);
    Led arm(model, settings);
    arm.controller.reset();
    for (int k = 0; k < 100; ++k) arm.tick();
    const Vibration& found = arm.controller.vibration();
    ASSERT_GE(found.count, 6);
    for (int i = 0; i < found.count; ++i) {
      EXPECT_NEAR(found.modes[static_cast<std::size_t>(i)].damping_ratio, 0.7, 1e-6);
    }
  }
}

TEST(DesignedInJoints, IsInTheTorque) {
  const RobotModel model = rubbing(testing::arms()[0], 0.5);
  Led led(model, rubbing_settings(model, Mode::kJoint));
  led.swing(0.3);
  led.state.velocity << 0.1, -0.2, 0.3, 0.1, -0.1, 0.2, 0.1;
  const JointVector velocity = led.state.velocity;
  led.tick();
  const JointVector moving = led.controller.snapshot().law_torque;
  const Eigen::MatrixXd C = led.damping() - 0.5 * Eigen::MatrixXd::Identity(7, 7);
  led.state.velocity.setZero();
  led.tick();
  const JointVector still = led.controller.snapshot().law_torque;
  EXPECT_GT((moving - still).norm(), 0.5);
  EXPECT_LT((moving - still + C * velocity).norm(), 1e-9);
}

// From one mode to the other and back: friction is taken off once, not twice.
TEST(DesignedInJoints, ChangesModesWithoutLosingDamping) {
  const RobotModel model = rubbing(testing::arms()[0], 0.5);
  Led led(model, rubbing_settings(model, Mode::kJoint));
  double least = 1e9;
  Eigen::MatrixXd before = led.damping();
  for (int k = 0; k < 2200; ++k) {
    if (k == 100) led.setpoint.mode = Mode::kCartesian;
    if (k == 1200) led.setpoint.mode = Mode::kJoint;
    ASSERT_LE(led.tick(), Status::kTorqueLimited);
    const Eigen::MatrixXd C = led.damping();
    least = std::min(least, Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(C).eigenvalues()[0]);
    EXPECT_LT((C - before).norm(), 0.05 * (1 + before.norm())) << "tick " << k;
    before = C;
  }
  EXPECT_GT(least, 0.4);  // the self-motion has nothing but friction
  EXPECT_LT(worst_ratio(led.controller.vibration()), 1e-6);
}

TEST(DesignedInJoints, NeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  for (const double friction : {0.0, 0.5, 30.0}) {
    const RobotModel model = rubbing(testing::arms()[0], friction);
    Led led(model, rubbing_settings(model, Mode::kJoint));
    const int count = testing::allocations_of([&] {
      for (int k = 0; k < 2000; ++k) {
        if (k % 700 == 500) led.setpoint.mode = Mode::kCartesian;
        if (k % 700 == 0) led.setpoint.mode = Mode::kJoint;
        if (k % 300 == 0) led.setpoint.gains.joint_damping_ratio = k % 600 == 0 ? 0 : 1.2;
        led.swing(1e-3 * k);
        led.tick();
      }
    });
    EXPECT_EQ(count, 0);
  }
}

TEST(DesignedInJoints, RefusesWhatIsNoRatio) {
  const RobotModel model = rubbing(testing::arms()[0], 0);
  for (const double wrong : {-1e-9, 2.0001, std::nan("")}) {
    Settings settings = rubbing_settings(model, Mode::kJoint);
    settings.initial.gains.joint_damping_ratio = wrong;
    try {
      Controller controller(model, settings);
      FAIL() << wrong;
    } catch (const InvalidSettings& error) {
      EXPECT_EQ(error.key(), "initial.gains.joint_damping_ratio");
    }
    EXPECT_STREQ(check_gains(settings.initial.gains, Mode::kJoint, 7).key, "joint_damping_ratio");
  }
}

}  // namespace
}  // namespace dashpot::controller
