// The dynamics against KDL's solvers and published figures.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/controller/model/mass_change.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dynamics_match.hpp>
#include <dashpot/tests/support/kdl_dynamics.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <map>
#include <numbers>
#include <string>

namespace dashpot::controller {
namespace {

using testing::all_arms;
using testing::arm_model;
using testing::arms;
using testing::by_kdl;
using testing::near;
using testing::Random;
using testing::RandomRobot;
using testing::same_dynamics;

constexpr double kTolerance = 1e-12;

/// `random_options`: every option set.
ModelOptions random_options(Random& random, int n) {
  ModelOptions options;
  options.gravity = random.vector(3) * 5;
  options.reflected_inertia = random.vector(n).cwiseAbs();
  options.payload.mass = random.uniform(0, 2);
  options.payload.center = random.vector(3) * 0.1;
  options.payload.inertia = 0.01 * Eigen::Matrix3d::Identity();
  options.tool.position = random.vector(3) * 0.2;
  options.tool.rotation =
      Eigen::AngleAxisd(random.uniform(-3, 3), random.vector(3).normalized()).toRotationMatrix();
  return options;
}

TEST(Dynamics, AreThoseOfKdl) {
  Random random(711);
  const auto expect_match = [&](const RobotModel& model, double reach) {
    const JointVector q = reach * random.vector(model.dof()), qd = random.vector(model.dof());
    const DynamicsResult found = evaluate(model, q, qd);
    ASSERT_TRUE(same_dynamics(found, by_kdl(model, q, qd), qd, kTolerance));
    ASSERT_EQ(found.M, found.M.transpose());
    ASSERT_EQ(Eigen::LLT<Eigen::MatrixXd>(found.M).info(), Eigen::Success);
  };
  for (int n = 1; n <= kMaxJoints; ++n) {
    for (int trial = 0; trial < 12; ++trial) {
      RandomRobot robot(random.engine()());
      const std::string text = robot.chain(n, trial % 3 == 0 ? 0 : trial % 3 == 1 ? 0.3 : 1);
      const ModelOptions options = trial % 2 == 0 ? ModelOptions() : random_options(random, n);
      SCOPED_TRACE("n = " + std::to_string(n) + ", trial " + std::to_string(trial) + "\n" + text);
      expect_match(RobotModel::from_urdf_text(text, "link0", "tip", options), 3);
    }
  }
  for (const auto& arm : all_arms()) {
    SCOPED_TRACE(arm.file);
    const RobotModel model = arm_model(arm);
    for (int trial = 0; trial < 100; ++trial) expect_match(model, 2);
  }
}

TEST(Dynamics, MassChangesAsDifferencesSay) {
  constexpr double kStep = 1e-5;
  Random random(712);
  const auto expect_match = [&](const RobotModel& model) {
    const int n = model.dof();
    const DynamicsKernel kernel(model);
    const JointVector q = 2 * random.vector(n), x = random.vector(n), none = JointVector::Zero(n);
    DynamicsResult there;
    kernel.evaluate(q, none, there);
    const JointMatrix found = MassChange(kernel, q, there.J).times(x);
    Eigen::MatrixXd expected(n, n);
    for (int k = 0; k < n; ++k) {
      DynamicsResult after, before;
      kernel.evaluate(q + kStep * JointVector::Unit(n, k), none, after);
      kernel.evaluate(q - kStep * JointVector::Unit(n, k), none, before);
      expected.col(k) = (after.M - before.M) * x / (2 * kStep);
    }
    EXPECT_TRUE(near(found, expected, 1e-8 * there.M.norm()));
  };
  for (int n = 1; n <= kMaxJoints; ++n) {
    for (int trial = 0; trial < 6; ++trial) {
      RandomRobot robot(random.engine()());
      const std::string text = robot.chain(n, trial % 3 == 0 ? 0 : trial % 3 == 1 ? 0.3 : 1);
      SCOPED_TRACE("n = " + std::to_string(n) + ", trial " + std::to_string(trial) + "\n" + text);
      expect_match(RobotModel::from_urdf_text(text, "link0", "tip", random_options(random, n)));
    }
  }
  for (const auto& arm : all_arms()) {
    SCOPED_TRACE(arm.file);
    expect_match(arm_model(arm));
  }
}

/// The public descriptions have the same values.
TEST(Dynamics, PutTheTipOfAnArmAtZeroWhereItIsPublished) {
  const std::map<std::string, Eigen::Vector3d> published = {
      {"panda", {0.088, 0, 0.8226}},     {"iiwa14", {0, 0, 1.306}},
      {"iiwa7", {0, 0, 1.266}},          {"fr3", {0.088, 0, 0.8226}},
      {"gen3", {0, -0.02485, 1.187385}}, {"xarm7", {0.206, 0, 0.1205}}};
  for (const auto& arm : all_arms()) {
    const auto found = published.find(arm.file);
    if (found == published.end()) continue;
    const JointVector zero = JointVector::Zero(7);
    const Eigen::Vector3d tip = evaluate(arm_model(arm), zero, zero).p_BT_B;
    EXPECT_LT((tip - found->second).norm(), 1e-6) << arm.file << ": " << tip.transpose();
  }
}

TEST(Dynamics, OfAPendulumAreThoseOfTheTextbook) {
  // 2 kg, 0.5 m from a horizontal axis along y; 0.1 kg m^2 about its centre of mass; at q from the
  // x axis downward.
  const RobotModel model = RobotModel::from_urdf_text(
      "<robot name='pendulum'><link name='a'/><link name='b'>" +
          testing::inertial(2, {0.5, 0, 0}, 0.1 * Eigen::Matrix3d::Identity()) +
          "</link><joint name='j' type='continuous'><parent link='a'/><child link='b'/>"
          "<axis xyz='0 1 0'/></joint></robot>",
      "a", "b");
  const double q = 0.3;
  const DynamicsResult result =
      evaluate(model, JointVector::Constant(1, q), JointVector::Constant(1, 2.0));
  EXPECT_NEAR(result.M(0, 0), 0.1 + 2 * 0.25, 1e-15);
  EXPECT_NEAR(result.gravity[0], -2 * 9.81 * 0.5 * std::cos(q), 1e-14);
  EXPECT_NEAR(result.coriolis[0], 0, 1e-15);
}

TEST(Dynamics, OfThePandaGiveTheTranslationalModesOfThePaper) {
  // Kao and Saldarriaga, Fig. 1 and Table 1, printed as 9.755, 10.98, 20.25 rad/s with damping
  // ratios 0.0294, 0.0316, 0.0255. The numbers below belong to the public model, with two fingers
  // of 15 g; the paper's rotational modes depend on different wrist inertias.
  JointVector q(7);
  q << 0, -std::numbers::pi / 4, 0, -3 * std::numbers::pi / 4, 0, std::numbers::pi / 2,
      std::numbers::pi / 4;
  ModelOptions fingers;
  fingers.payload.mass = 2 * 0.015;
  fingers.payload.center.z() = 0.0584 - 0.1034;  // their origin and the tip, from the hand
  const DynamicsResult dynamics = evaluate(arm_model(arms()[0], fingers), q, JointVector::Zero(7));
  const auto diagonal = [](const Vector6& v) { return Eigen::MatrixXd(v.asDiagonal()); };
  analysis::TaskImpedance impedance;
  impedance.mass = dynamics.M;
  impedance.jacobian = dynamics.J;
  impedance.task_stiffness = diagonal(Vector6{{2000, 600, 2000, 100, 100, 100}});
  impedance.task_damping = diagonal(Vector6{{5, 3, 5, 1, 1, 1}});
  const analysis::Spectrum<> spectrum = analysis::analyze(analysis::to_joint_space(impedance));
  ASSERT_EQ(spectrum.modes.size(), 6);
  const double known[][2] = {{20.234, 0.0255}, {10.892, 0.0316}, {9.761, 0.0295}};
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(spectrum.modes[3 + i].natural_frequency, known[i][0], 5.1e-4) << i;
    EXPECT_NEAR(spectrum.modes[3 + i].damping_ratio, known[i][1], 5.1e-5) << i;
  }
}

TEST(Dynamics, PassOnWhatIsNotFiniteAndRefuseStatesOfAnotherSize) {
  const RobotModel model = arm_model(arms()[0]);
  const JointVector zero = JointVector::Zero(7);
  JointVector q = zero;
  q[3] = std::numeric_limits<double>::quiet_NaN();
  const DynamicsResult result = evaluate(model, q, zero);
  EXPECT_FALSE(result.M.allFinite());
  EXPECT_FALSE(result.gravity.allFinite());
  EXPECT_FALSE(result.p_BT_B.allFinite());
  EXPECT_THROW(evaluate(model, JointVector::Zero(6), zero), std::invalid_argument);
  EXPECT_THROW(evaluate(model, zero, JointVector::Zero(8)), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::controller
