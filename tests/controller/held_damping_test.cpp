// The controller designs its damping at every tick: the ratio is held, in the modes and in the
// torque, and nothing jumps.
#include <dashpot/controller/held_damping.hpp>
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dashpot::controller {
namespace {

using testing::SimulatedArm;

/// An arm without friction.
RobotModel smooth_arm(const testing::Arm& arm) {
  ModelOptions options;
  options.damping = Eigen::VectorXd::Zero(testing::arm_model(arm).dof());
  return testing::arm_model(arm, options);
}

RobotModel panda() {
  return smooth_arm(testing::arms()[0]);
}

/// Nothing acts but springs and dampers of the tip, and no limit interferes.
Settings plain_settings(const RobotModel& model) {
  Settings settings = default_settings(model);
  settings.initial.mode = Mode::kCartesian;
  settings.initial.gains.null_stiffness.setZero();
  settings.initial.gains.null_damping.setZero();
  settings.initial.gains.task_damping_ratio = 0.7;
  settings.initial.gains.task_stiffness = Vector6(2000, 600, 2000, 100, 100, 100).asDiagonal();
  settings.feed_forward = {false, false, false, false, false};
  settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
  settings.limits.velocity.setConstant(1e3);
  settings.limits.position_lower.setConstant(-10);
  settings.limits.position_upper.setConstant(10);
  return settings;
}

/// Led along a path; nothing but its state matters.
struct LedArm {
  LedArm(const RobotModel& robot, const Settings& settings)
      : model(robot), controller(robot, settings), setpoint(settings.initial) {
    center = JointVector::LinSpaced(model.dof(), 0.3, 1.2);
    if (model.dof() == 7) center << 0, -0.785, 0.1, -2.2, 0.2, 1.7, 0.785;
    place(center);
    const DynamicsResult there = evaluate(model, center, state.velocity);
    setpoint.joint_position = center;
    setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  }
  void place(const JointVector& q) {
    state.position = q;
    state.velocity = JointVector::Zero(q.size());
  }
  /// Swings of 0.4 rad, one in 2 s.
  void swing(double t) {
    for (Eigen::Index i = 0; i < center.size(); ++i) {
      const double phase = std::numbers::pi * t + static_cast<double>(i);
      state.position[i] = center[i] + 0.4 * (std::sin(phase) - std::sin(static_cast<double>(i)));
      state.velocity[i] = 0.4 * std::numbers::pi * std::cos(phase);
    }
  }
  Status tick() {
    setpoint.time = state.time += 1'000'000;
    return controller.update(state, setpoint, torque);
  }
  /// Until the gains have grown.
  void settle() {
    const int ticks = static_cast<int>(controller.settings().motion.gain_time * 1000) + 2;
    for (int k = 0; k < ticks; ++k) tick();
  }
  /// C, n x n
  Eigen::MatrixXd damping() const {
    analysis::System<kMaxJoints> system;
    controller.closed_loop(system);
    return system.damping;
  }

  RobotModel model;
  Controller controller;
  RobotState state;
  Setpoint setpoint;
  JointVector center, torque;
};

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

TEST(HeldDamping, HoldsTheRatioAlongAPathOfEveryArm) {
  for (const testing::Arm& arm : testing::arms()) {
    for (const Frame frame : {Frame::kBase, Frame::kTool}) {
      SCOPED_TRACE(std::string(arm.file) + (frame == Frame::kBase ? " base" : " tool"));
      const RobotModel model = smooth_arm(arm);
      Settings settings = plain_settings(model);
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

TEST(HeldDamping, LeavesFreeDirectionsAndTheNullSpaceAlone) {
  const RobotModel model = panda();
  Settings settings = plain_settings(model);
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
TEST(HeldDamping, IsInTheTorque) {
  for (const Frame frame : {Frame::kBase, Frame::kTool}) {
    const RobotModel model = panda();
    Settings settings = plain_settings(model);
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

TEST(HeldDamping, FollowsChangesOfStiffnessAndRatio) {
  const RobotModel model = panda();
  LedArm led(model, plain_settings(model));
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
TEST(HeldDamping, TheRatioChangesEvenly) {
  const RobotModel model = panda();
  LedArm led(model, plain_settings(model));
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

TEST(HeldDamping, IsSemidefiniteWhateverChanges) {
  const RobotModel model = panda();
  LedArm led(model, plain_settings(model));
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
TEST(HeldDamping, IsBoundedThroughASingularity) {
  const RobotModel model = panda();
  Settings settings = plain_settings(model);
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

TEST(HeldDamping, ChangesAreSmoothInMotion) {
  const RobotModel model = panda();
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

TEST(HeldDamping, NeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  const RobotModel model = panda();
  LedArm led(model, plain_settings(model));
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

TEST(HeldDamping, KeepsTheLastDesignWhereThereIsNone) {
  TaskDamper damper;
  damper.set(Matrix6(100 * Matrix6::Identity()), 0.7, {});
  analysis::Square<kMaxJoints> M = Eigen::MatrixXd::Identity(7, 7), broken = M;
  analysis::TaskJacobian<kMaxJoints> J = Eigen::MatrixXd::Identity(6, 7);
  broken(3, 3) = -1;
  damper.update(broken, J);
  EXPECT_EQ(damper.damping(), Matrix6::Zero());
  damper.update(M, J);
  const Matrix6 good = damper.damping();
  EXPECT_TRUE(
      testing::near(Eigen::MatrixXd(good), Eigen::MatrixXd(14 * Matrix6::Identity()), 1e-9));
  for (const double wrong : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    broken = M;
    broken(3, 3) = wrong;
    damper.update(broken, J);
    EXPECT_EQ(damper.damping(), good);
  }
  // A stiffness that rounding has made indefinite, as far as check_gains lets it pass, is taken.
  Matrix6 flat = Vector6(100, 100, 100, 100, 100, -5e-9).asDiagonal();
  damper.set(flat, 0.35, {});
  damper.update(M, J);
  EXPECT_NEAR(damper.damping()(0, 0), 7, 1e-6);
  EXPECT_NEAR(damper.damping()(5, 5), 0, 1e-3);
}

TEST(HeldDamping, IsBoundedHoweverSingularTheJacobian) {
  TaskDamper damper;
  const double K = 2000, ratio = 0.7;
  damper.set(Matrix6(K * Matrix6::Identity()), ratio, {});
  double largest = 0;
  for (int k = 0; k < 200; ++k) {
    analysis::Square<kMaxJoints> M = Eigen::MatrixXd::Identity(7, 7);
    analysis::TaskJacobian<kMaxJoints> J = Eigen::MatrixXd::Identity(6, 7);
    J.row(2) *= std::pow(10, -0.1 * k);  // its frequency falls from 45 to 4e-19 rad/s
    damper.update(M, J);
    const Matrix6& C_C = damper.damping();
    EXPECT_GE(Eigen::SelfAdjointEigenSolver<Matrix6>(C_C).eigenvalues()[0], -1e-9);
    largest = std::max(largest, C_C(2, 2));
  }
  EXPECT_LT(largest, 2.3 * ratio * K / TaskDamper::kSoftFrequency);
  EXPECT_GT(largest, 1.9 * ratio * K / TaskDamper::kSoftFrequency);
}

TEST(HeldDamping, RefusesWhatIsNoRatio) {
  const RobotModel model = panda();
  const Settings settings = plain_settings(model);
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
