// The controller designs its damping at every tick: modes and torque keep the ratio, with friction
// and in either mode, and nothing jumps.
#include <dashpot/controller/setpoint_check.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
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

/// An arm whose every joint has this viscous friction, N m s/rad.
RobotModel rubbing(const testing::Arm& arm, double friction) {
  if (friction == 0) return testing::smooth_arm(arm);
  ModelOptions options;
  options.viscous_friction = Eigen::VectorXd::Constant(testing::arm_model(arm).dof(), friction);
  options.reflected_inertia = Eigen::VectorXd::Constant(options.viscous_friction.size(), 0.1);
  return testing::arm_model(arm, options);
}

/// Only springs, and dampers that keep their ratio, with the friction subtracted.
Settings rubbing_settings(const RobotModel& model, Mode mode, Frame frame = Frame::kBase) {
  Settings settings = plain_settings(model, mode);
  settings.subtract_friction = true;
  settings.initial.gains.frame = frame;
  return settings;
}

double least_eigenvalue_of(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A).eigenvalues()[0];
}

/// Largest difference of a published ratio from this one, of modes that are not soft (the UR5
/// passes a singularity).
double worst_ratio(const Vibration& modes, double ratio = 0.7) {
  double worst = 0;
  for (int i = 0; i < modes.count; ++i) {
    const VibrationMode& mode = modes.modes[testing::at(i)];
    if (mode.natural_frequency >= 0.11) {
      worst = std::max(worst, std::abs(mode.damping_ratio - ratio));
    }
  }
  return worst;
}

/// Expects the damping ratio of the eigenvalues above 1 rad/s, in the active dampers and springs; M
/// and J come from evaluate().
void expect_true_ratios(const LedArm& led, double ratio, double tolerance) {
  analysis::System<kMaxJoints> published;
  led.controller.closed_loop(published);
  const JointVector& q = led.state.position;
  const DynamicsResult robot = evaluate(led.model, q, JointVector::Zero(q.size()));
  const Gains& gains = led.setpoint.gains;
  MatrixXd K = gains.joint_stiffness;
  if (led.setpoint.mode == Mode::kCartesian) {
    MatrixXd J = robot.J;
    if (gains.frame == Frame::kTool) {
      J.topRows(3) = (robot.R_BT.transpose() * J.topRows(3)).eval();
      J.bottomRows(3) = (robot.R_BT.transpose() * J.bottomRows(3)).eval();
    }
    K = J.transpose() * gains.task_stiffness * J;
  }
  int seen = 0;
  for (const testing::LongComplex value : testing::true_eigenvalues(
           testing::system_from(robot.M, published.damping, testing::symmetrized(K)))) {
    if (std::abs(value) < 1) continue;
    ++seen;
    EXPECT_NEAR(static_cast<double>(-value.real() / std::abs(value)), std::min(ratio, 1.0),
                tolerance);  // real ones above 1
  }
  EXPECT_GE(seen, 10);
}

// Published modes include the friction, so that they are compared.
TEST(DesignedDamping, HoldsTheRatioAlongAPathOfEveryArm) {
  const struct {
    Mode mode;
    Frame frame;
    double ratio, friction;
  } cases[] = {
      {Mode::kCartesian, Frame::kBase, 0.7, 0},   {Mode::kCartesian, Frame::kTool, 0.25, 0},
      {Mode::kCartesian, Frame::kBase, 0.7, 0.3}, {Mode::kCartesian, Frame::kTool, 0.7, 0.3},
      {Mode::kJoint, Frame::kBase, 0.7, 0},       {Mode::kJoint, Frame::kBase, 0.7, 0.5}};
  for (const testing::Arm& arm : testing::arms()) {
    for (const auto& [mode, frame, ratio, friction] : cases) {
      const bool tip = mode == Mode::kCartesian;
      SCOPED_TRACE(std::string(arm.file) + (tip ? " tip" : " joints") + ", friction " +
                   std::to_string(friction) + ", ratio " + std::to_string(ratio));
      const RobotModel model = rubbing(arm, friction);
      Settings settings = rubbing_settings(model, mode, frame);
      settings.initial.gains.task_damping_ratio = ratio;
      LedArm led(model, settings);
      led.settle();
      // Friction couples the modes of the tip with the motion that no spring resists.
      const double tolerance = tip && friction > 0 && model.dof() > 6 ? 2e-3 : 1e-6;
      int soft = 0;
      for (int k = 1; k <= 300; ++k) {
        led.swing((friction > 0 ? 1e-3 : 3e-3) * k);
        ASSERT_LE(led.tick(), Status::kNearJointLimit);
        const Vibration& modes = led.modes();
        ASSERT_EQ(modes.position, led.state.position);
        ASSERT_EQ(modes.count, tip ? 6 : model.dof());
        EXPECT_LE(worst_ratio(modes, ratio), tolerance) << "tick " << k;
        for (int i = 0; i < modes.count; ++i) {
          soft += modes.modes[testing::at(i)].natural_frequency < 0.11 ? 1 : 0;
        }
        if (k % 50 == 0 && friction == 0) expect_true_ratios(led, ratio, 1e-6);
      }
      EXPECT_LT(soft, 30);
      EXPECT_EQ(led.modes().counters.failed, 0u);
    }
  }
}

/// Springs of the tip and, without a projector, of all joints have the task's ratio together.
TEST(DesignedDamping, HoldsOneRatioOfSpringsAtTheTipAndInTheJoints) {
  for (const testing::Arm& arm : testing::arms()) {
    SCOPED_TRACE(arm.file);
    const RobotModel model = testing::smooth_arm(arm);
    Settings settings = plain_settings(model, Mode::kCartesian);
    Gains& gains = settings.initial.gains;
    gains.null_projector = NullProjector::kNone;
    gains.task_damping_ratio = 0.4;
    gains.null_damping_ratio = 0.7;
    gains.null_stiffness.setConstant(30);
    LedArm led(model, settings);
    led.settle();
    for (int k = 1; k <= 200; ++k) {
      led.swing(3e-3 * k);
      ASSERT_LE(led.tick(), Status::kNearJointLimit);
      ASSERT_EQ(led.modes().count, model.dof());
      EXPECT_LE(worst_ratio(led.modes(), 0.4), 1e-6) << "tick " << k;
    }
    EXPECT_EQ(led.controller.snapshot().task_damping_ratio, 0.4);
    led.setpoint.gains.task_damping_ratio = 0;  // each by itself
    led.setpoint.gains.task_damping.setZero();
    led.settle();
    const DynamicsResult robot =
        evaluate(model, led.state.position, JointVector::Zero(model.dof()));
    const Eigen::LLT<MatrixXd> L{MatrixXd(robot.M)};
    const MatrixXd inverse = MatrixXd(L.matrixL()).inverse();
    const MatrixXd K = 30 * inverse * inverse.transpose();
    const MatrixXd root = Eigen::SelfAdjointEigenSolver<MatrixXd>(K).operatorSqrt();
    EXPECT_TRUE(
        near(inverse * led.damping() * inverse.transpose(), 1.4 * root, 1e-9 * root.norm()));
  }
}

TEST(DesignedDamping, LosesNoModesOfALongChain) {
  // Modes near each other were lost once.
  testing::RandomRobot random(20210001);
  const RobotModel model = RobotModel::from_urdf_text(random.chain(14, 0), "link0", "tip");
  Settings settings = testing::in_mode(testing::unlimited_settings(model), Mode::kCartesian);
  settings.initial.gains.task_damping_ratio = 0.7;
  settings.limits.torque.setConstant(1e4);  // holds the weight
  LedArm led(model, settings, 0.2);
  led.place(led.center = settings.initial.joint_position);
  led.settle();
  const auto before = led.modes().counters;
  for (int k = 1; k <= 2000; ++k) {  // a swing
    led.swing(1e-3 * k);
    ASSERT_LE(led.tick(), Status::kNearJointLimit);
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
  ASSERT_EQ(led.modes().count, 7);
  const auto& modes = led.modes().modes;
  EXPECT_EQ(std::count_if(modes.begin(), modes.begin() + 7,
                          [](const auto& m) { return std::abs(m.damping_ratio - 0.7) < 1e-6; }),
            4);
}

/// The dampers add C of the published modes, less the friction, times the velocity to the torque.
TEST(DesignedDamping, IsInTheTorque) {
  for (const auto& [mode, frame] : {std::pair(Mode::kCartesian, Frame::kBase),
                                    {Mode::kCartesian, Frame::kTool},
                                    {Mode::kJoint, Frame::kBase}}) {
    const double friction = mode == Mode::kJoint ? 0.5 : 0;
    const RobotModel model = rubbing(testing::arms()[0], friction);
    LedArm led(model, rubbing_settings(model, mode, frame));
    led.settle();
    led.swing(0.4);
    const JointVector velocity = led.state.velocity;
    led.tick();
    const MatrixXd moving = led.controller.snapshot().law_torque;
    const MatrixXd C = led.damping() - friction * MatrixXd::Identity(7, 7);
    led.state.velocity.setZero();
    led.tick();
    const MatrixXd added = moving - led.controller.snapshot().law_torque;
    EXPECT_GT(added.norm(), 1);
    EXPECT_TRUE(near(added, -C * velocity, 1e-9 * added.norm()));
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
    expect_true_ratios(led, ratio, 1e-6);
  }
  // Half-way between two stiffnesses in two frames both have the ratio.
  gains.task_stiffness *= 8;
  gains.task_stiffness(0, 0) *= 3;
  gains.frame = Frame::kTool;
  for (int k = 0; k < 600; ++k) {
    led.swing(1e-3 * k);
    led.tick();
    EXPECT_LE(worst_ratio(led.modes()), 1e-6);
  }
  // And off: the given damping.
  gains.task_damping_ratio = 0;
  led.settle();
  gains.frame = Frame::kBase;
  led.settle();
  const MatrixXd J = evaluate(model, led.state.position, led.state.velocity).J;
  EXPECT_TRUE(near(led.damping(), J.transpose() * gains.task_damping * J, 1e-9));
}

/// On, another, off: evenly over Motion::gain_time. A change of stiffness and frame in the middle
/// of another change, and from mode to mode, makes no jump.
TEST(DesignedDamping, ChangesEvenly) {
  const RobotModel model = smooth_panda();
  LedArm led(model, plain_settings(model, Mode::kCartesian));
  led.settle();
  led.state.velocity.setConstant(0.3);
  led.tick();
  const auto law = [&]() -> JointVector { return led.controller.snapshot().law_torque; };
  /// Largest step of the law's torque within a number of ticks, and its change over all of them.
  const auto change = [&](int ticks) {
    const JointVector first = law();
    JointVector last = first;
    double step = 0;
    for (int k = 0; k < ticks; ++k) {
      led.tick();
      step = std::max(step, (law() - last).norm());
      last = law();
    }
    return std::pair(step, (last - first).norm());
  };
  Gains& gains = led.setpoint.gains;
  for (const double ratio : {1.4, 0.0, 0.7}) {
    gains.task_damping_ratio = ratio;
    const auto [step, whole] = change(505);
    EXPECT_GT(whole, 1);
    EXPECT_LT(step, 1.01 / 500 * whole);
  }
  for (int k = 0; k < 5; ++k) {
    SCOPED_TRACE(k);
    gains.task_stiffness *= k % 2 == 0 ? 0.25 : 4;
    gains.frame = k % 2 == 0 ? Frame::kTool : Frame::kBase;
    gains.task_damping_ratio = k % 2 == 0 ? 0 : 1.2;
    if (k > 2) led.setpoint.mode = k == 3 ? Mode::kJoint : Mode::kCartesian;
    const double step = std::max(change(250).first, [&] {
      gains.task_damping_ratio = 0.3;
      return change(505).first;
    }());
    EXPECT_LT(step, 0.08);
  }
}

/// Springs that grow from zero, at first and after a reset, have their ratio from the start, also
/// in the null space.
TEST(DesignedDamping, HoldsTheRatioWhileTheSpringsGrow) {
  const RobotModel model = smooth_panda();
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    Settings settings = plain_settings(model, mode);
    settings.initial.gains.null_stiffness.setConstant(20);
    settings.initial.gains.null_damping_ratio = 0.7;
    LedArm arm(model, settings);
    for (int again = 0; again < 2; ++again) {
      for (int k = 0; k < 50; ++k) ASSERT_LE(arm.tick(), Status::kTorqueLimited);  // of 500
      ASSERT_EQ(arm.modes().count, 7);
      EXPECT_LE(worst_ratio(arm.modes()), 1e-6);
      arm.settle();
      arm.controller.reset();
    }
  }
}

// From one mode to the other and back: friction is taken off once, not twice.
TEST(DesignedDamping, ChangesModesWithoutLosingDamping) {
  const RobotModel model = rubbing(testing::arms()[0], 0.5);
  LedArm led(model, rubbing_settings(model, Mode::kJoint));
  led.settle();
  double least = 1e9;
  MatrixXd before = led.damping();
  for (int k = 0; k < 1300; ++k) {
    if (k == 10) led.setpoint.mode = Mode::kCartesian;
    if (k == 650) led.setpoint.mode = Mode::kJoint;
    ASSERT_LE(led.tick(), Status::kTorqueLimited);
    const MatrixXd C = led.damping();
    least = std::min(least, least_eigenvalue_of(C));
    EXPECT_LT((C - before).norm(), 0.05 * (1 + before.norm())) << "tick " << k;
    before = C;
  }
  EXPECT_GT(least, 0.4);  // the self-motion has nothing but friction
  EXPECT_LT(worst_ratio(led.modes()), 1e-6);
}

TEST(DesignedDamping, IsSemidefiniteWhateverChanges) {
  const RobotModel model = smooth_panda();
  LedArm led(model, plain_settings(model, Mode::kCartesian));
  testing::Random random(20210606);
  Gains& gains = led.setpoint.gains;
  double smallest = 0, largest = 0;
  for (int k = 0; k < 9'000; ++k) {
    if (k % 150 == 0) {
      const Eigen::Index rank = 1 + k / 150 % 6;
      const MatrixXd root = 20 * random.matrix(6, rank);
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
    const MatrixXd C = led.damping();
    smallest = std::min(smallest, least_eigenvalue_of(C) / std::max(C.norm(), 1e-9));
    largest = std::max(largest, C.norm());
  }
  EXPECT_GT(smallest, -1e-12);
  EXPECT_GT(largest, 10);
}

TEST(DesignedDamping, RefusesWhatIsNoRatio) {
  const RobotModel model = smooth_panda();
  for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
    const std::string key = mode == Mode::kJoint ? "joint_damping_ratio" : "task_damping_ratio";
    const auto ratio_of = [&](Gains& gains) -> double& {
      return mode == Mode::kJoint ? gains.joint_damping_ratio : gains.task_damping_ratio;
    };
    for (const double wrong : {-1e-9, 2.0001, std::numeric_limits<double>::infinity(),
                               std::numeric_limits<double>::quiet_NaN()}) {
      Settings bad = plain_settings(model, mode);
      LedArm led(model, bad);
      ratio_of(bad.initial.gains) = wrong;
      try {
        Controller controller(model, bad);
        FAIL() << wrong;
      } catch (const InvalidSettings& error) {
        EXPECT_EQ(error.key(), "initial.gains." + key);
        EXPECT_NE(std::string(error.what()).find("must be between 0 and 2"), std::string::npos);
      }
      EXPECT_EQ(check_gains(bad.initial.gains, mode, 7).key, key);
      led.settle();
      const MatrixXd before = led.damping();
      ratio_of(led.setpoint.gains) = wrong;
      EXPECT_EQ(led.tick(), Status::kSetpointRejected);
      led.settle();
      EXPECT_TRUE(near(led.damping(), before, 1e-9));
    }
  }
}

}  // namespace
}  // namespace dashpot::controller
