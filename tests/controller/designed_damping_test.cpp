// The controller designs its damping at every tick: the ratio is held, in the modes and in the
// torque, and nothing jumps.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random_robot.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace dashpot::controller {
namespace {

using testing::LedArm;
using testing::plain_settings;
using testing::SimulatedArm;
using testing::smooth_arm;
using testing::smooth_panda;
using testing::unlimited_settings;

/// K_C in B's axes.
Eigen::MatrixXd stiffness_in_base(const Gains& gains, const Eigen::Matrix3d& R_BT) {
  if (gains.frame == Frame::kBase) return gains.task_stiffness;
  Eigen::MatrixXd turn = Eigen::MatrixXd::Zero(6, 6);
  turn.topLeftCorner(3, 3) = turn.bottomRightCorner(3, 3) = R_BT;
  return turn * gains.task_stiffness * turn.transpose();
}

/// Frequencies and damping ratios at joint position q, with the damping C (n x n), from eigenvalues
/// of the first-order system; those above 1 rad/s.
std::vector<double> ratios_at(const RobotModel& model, const JointVector& q, const Gains& gains,
                              const Eigen::MatrixXd& C) {
  const Eigen::Index n = q.size();
  const DynamicsResult robot = evaluate(model, q, JointVector::Zero(n));
  const Eigen::MatrixXd J = robot.J, Minv = Eigen::MatrixXd(robot.M).inverse();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  A.topRightCorner(n, n).setIdentity();
  A.bottomLeftCorner(n, n) = -Minv * J.transpose() * stiffness_in_base(gains, robot.R_BT) * J;
  A.bottomRightCorner(n, n) = -Minv * C;
  std::vector<double> ratios;
  const Eigen::VectorXcd values = Eigen::EigenSolver<Eigen::MatrixXd>(A, false).eigenvalues();
  for (const std::complex<double>& value : values) {
    if (std::abs(value) > 1) ratios.push_back(-value.real() / std::abs(value));
  }
  return ratios;
}

TEST(DesignedDamping, HoldsTheRatioAlongAPathOfEveryArm) {
  for (const testing::Arm& arm : testing::arms()) {
    for (const Frame frame : {Frame::kBase, Frame::kTool}) {
      SCOPED_TRACE(std::string(arm.file) + (frame == Frame::kBase ? " base" : " tool"));
      const RobotModel model = smooth_arm(arm);
      Settings settings = plain_settings(model, Mode::kCartesian);
      Gains& gains = settings.initial.gains;
      gains.frame = frame;
      gains.task_damping_ratio = frame == Frame::kBase ? 0.7 : 0.25;
      LedArm led(model, settings);
      led.settle();
      int held = 0, soft = 0;
      for (int k = 1; k <= 1000; ++k) {
        led.swing(1e-3 * k);
        ASSERT_LE(led.tick(), Status::kTorqueLimited);
        const Vibration& modes = led.controller.vibration();
        ASSERT_EQ(modes.position, led.state.position);
        ASSERT_EQ(modes.count, 6);
        for (int i = 0; i < modes.count; ++i) {
          const VibrationMode& mode = modes.modes[static_cast<std::size_t>(i)];
          ++(mode.natural_frequency < 0.11 ? soft : held);  // the UR5 passes a singularity
          if (mode.natural_frequency < 0.11) continue;
          EXPECT_NEAR(mode.damping_ratio, gains.task_damping_ratio, 1e-6) << "tick " << k;
        }
        if (k % 20 != 0) continue;
        const auto ratios = ratios_at(model, modes.position, gains, led.damping());
        EXPECT_GE(ratios.size(), 10u);
        for (const double ratio : ratios) {
          EXPECT_NEAR(ratio, gains.task_damping_ratio, 1e-6) << "tick " << k;
        }
      }
      EXPECT_LT(soft, 100);
      EXPECT_EQ(held + soft, 6000);
      EXPECT_EQ(led.controller.vibration().counters.failed, 0u);
    }
  }
}

TEST(DesignedDamping, LosesNoModesOfALongChain) {
  // Modes that are near each other were lost once.
  testing::RandomRobot random(20210001);
  const RobotModel model = RobotModel::from_urdf_text(random.chain(14, 0), "link0", "tip");
  Settings settings = unlimited_settings(model);
  settings.initial.mode = Mode::kCartesian;
  settings.initial.gains.task_damping_ratio = 0.7;
  settings.limits.torque.setConstant(1e4);  // holds the weight
  LedArm led(model, settings, 0.2);
  led.place(led.center = settings.initial.joint_position);
  led.settle();
  const auto before = led.modes().counters;
  for (int k = 1; k <= 4000; ++k) {
    led.swing(1e-3 * k);
    ASSERT_LE(led.tick(), Status::kTorqueLimited);
    ASSERT_EQ(led.modes().status, analysis::Status::kOk);
  }
  EXPECT_EQ(led.modes().counters.direct - before.direct, 0U);
}

TEST(DesignedDamping, LeavesFreeDirectionsAndTheNullSpaceAlone) {
  const RobotModel model = smooth_panda();
  Settings settings = plain_settings(model, Mode::kCartesian);
  Gains& gains = settings.initial.gains;
  gains.directions = {true, true, true, false, false, true};
  gains.null_stiffness.setConstant(5);
  gains.null_damping.setConstant(0.5);
  LedArm led(model, settings);
  led.settle();
  led.swing(0.3);
  led.tick();
  const Vibration& modes = led.controller.vibration();
  ASSERT_EQ(modes.count, 7);
  int held = 0;
  for (std::size_t i = 0; i < 7; ++i) {
    held += std::abs(modes.modes[i].damping_ratio - 0.7) < 1e-6 ? 1 : 0;
  }
  EXPECT_EQ(held, 4);
}

/// What the dampers add to the torque is C of the published modes times the velocity.
TEST(DesignedDamping, IsInTheTorque) {
  for (const Frame frame : {Frame::kBase, Frame::kTool}) {
    const RobotModel model = smooth_panda();
    Settings settings = plain_settings(model, Mode::kCartesian);
    settings.initial.gains.frame = frame;
    LedArm led(model, settings);
    led.settle();
    led.swing(0.4);
    const JointVector velocity = led.state.velocity;
    led.tick();
    const JointVector moving = led.controller.snapshot().law_torque;
    const Eigen::MatrixXd C = led.damping();
    led.state.velocity.setZero();
    led.tick();
    const JointVector still = led.controller.snapshot().law_torque;
    EXPECT_GT((moving - still).norm(), 1);
    EXPECT_TRUE(testing::near(Eigen::MatrixXd(moving - still), Eigen::MatrixXd(-C * velocity),
                              1e-9 * (moving - still).norm()));
  }
}

TEST(DesignedDamping, FollowsChangesOfStiffnessAndRatio) {
  const RobotModel model = smooth_panda();
  LedArm led(model, plain_settings(model, Mode::kCartesian));
  led.settle();
  Gains& gains = led.setpoint.gains;
  for (const double ratio : {0.2, 2.0, 0.7}) {
    gains.task_stiffness *= 0.5;
    gains.task_damping_ratio = ratio;
    led.settle();
    for (const double held : ratios_at(model, led.state.position, gains, led.damping())) {
      EXPECT_NEAR(held, std::min(ratio, 1.0), 1e-6);  // real eigenvalues above 1
    }
  }
  // Half-way between two stiffnesses in two frames the ratio is that of both.
  gains.task_stiffness *= 8;
  gains.task_stiffness(0, 0) *= 3;
  gains.frame = Frame::kTool;
  for (int k = 0; k < 600; ++k) {
    led.swing(1e-3 * k);
    led.tick();
    const Vibration& modes = led.controller.vibration();
    for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(modes.modes[i].damping_ratio, 0.7, 1e-6);
  }
  // And off: the damping that was given.
  gains.task_damping_ratio = 0;
  led.settle();
  gains.frame = Frame::kBase;
  led.settle();
  const Eigen::MatrixXd J = evaluate(model, led.state.position, led.state.velocity).J;
  EXPECT_TRUE(
      testing::near(led.damping(), Eigen::MatrixXd(J.transpose() * gains.task_damping * J), 1e-9));
}

/// On, another, off: evenly over Motion::gain_time.
TEST(DesignedDamping, TheRatioChangesEvenly) {
  const RobotModel model = smooth_panda();
  LedArm led(model, plain_settings(model, Mode::kCartesian));
  led.settle();
  led.state.velocity.setConstant(0.3);
  led.tick();
  for (const double ratio : {1.4, 0.0, 0.7}) {
    led.setpoint.gains.task_damping_ratio = ratio;
    JointVector last = led.controller.snapshot().law_torque;
    const JointVector first = last;
    double step = 0;
    for (int k = 0; k < 505; ++k) {
      led.tick();
      const JointVector now = led.controller.snapshot().law_torque;
      step = std::max(step, (now - last).norm());
      last = now;
    }
    EXPECT_GT((last - first).norm(), 1);
    EXPECT_LT(step, 1.01 / 500 * (last - first).norm());
  }
}

/// The largest change of the law's torque from tick to tick, as a share of the rate limit.
double rate_share(SimulatedArm& arm, double seconds) {
  const Settings& settings = arm.controller.settings();
  const JointVector largest_step = settings.limits.torque_rate * settings.period;
  double share = 0;
  JointVector last;
  for (int k = 0; k < static_cast<int>(seconds / settings.period); ++k) {
    EXPECT_EQ(arm.step(), Status::kOk);
    const JointVector now = arm.controller.snapshot().law_torque;
    if (k > 0) {
      share = std::max(share, (now - last).cwiseAbs().cwiseQuotient(largest_step).maxCoeff());
    }
    last = now;
  }
  return share;
}

TEST(DesignedDamping, ChangesAreSmoothInMotion) {
  const RobotModel model = smooth_panda();
  SimulatedArm arm(model, testing::quiet_settings(model), testing::panda_ready());
  arm.setpoint.mode = Mode::kCartesian;
  Gains& gains = arm.setpoint.gains;
  EXPECT_LT(rate_share(arm, 1), 0.5);
  const double y = arm.setpoint.tip_pose.position.y();
  int moves = 0;
  for (const double ratio : {0.7, 0.3, 1.2, 0.0, 1.0, 0.0, 0.7}) {
    SCOPED_TRACE(ratio);
    ++moves;
    arm.setpoint.tip_pose.position.y() = moves % 2 == 1 ? y + 0.1 : y;
    EXPECT_LT(rate_share(arm, 0.2), 0.25);
    gains.task_damping_ratio = ratio;
    gains.task_stiffness *= moves % 2 == 0 ? 0.25 : 4;
    if (moves % 3 == 0) gains.frame = gains.frame == Frame::kBase ? Frame::kTool : Frame::kBase;
    EXPECT_LT(rate_share(arm, 0.25), 0.25);
    gains.task_damping_ratio = 0.5 * ratio + 0.1;  // in the middle of the change
    EXPECT_LT(rate_share(arm, 1), 0.25);
  }
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    arm.setpoint.mode = mode;
    arm.setpoint.joint_position = arm.state.position;
    arm.setpoint.tip_pose = arm.tip();
    EXPECT_LT(rate_share(arm, 1), 0.25);
  }
}

}  // namespace
}  // namespace dashpot::controller
