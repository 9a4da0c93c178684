// The dynamics against KDL's solvers, against derivatives of pose and energy, and kernels of
// different size against one another.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/controller/kdl_chain.hpp>
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

std::vector<RobotModel> models() {
  std::vector<RobotModel> all;
  for (const auto& arm : arms()) all.push_back(arm_model(arm));
  for (const int n : {1, 3, 5, 9}) {
    all.push_back(RobotModel::from_urdf_text(
        RandomRobot(100 + static_cast<unsigned>(n)).chain(n, 0.3), "link0", "tip"));
  }
  return all;
}

/// (f(x + h) - f(x - h)) / 2h by fourth order, to about 1e-6.
template <class Function>
auto derivative(const Function& f) {
  constexpr double h = 1e-4;
  return ((8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)).eval();
}

TEST(Dynamics, HaveTheDerivativesOfThePoseForJAndJdot) {
  Random random(722);
  for (const RobotModel& model : models()) {
    SCOPED_TRACE(model.name());
    const JointVector q = random.vector(model.dof()), qd = random.vector(model.dof());
    const DynamicsResult at = evaluate(model, q, qd);
    const auto moved = [&](double h) { return evaluate(model, q + h * qd, qd); };
    const Eigen::Vector3d v = derivative([&](double h) { return moved(h).p_BT_B; });
    const Eigen::Matrix3d spin =
        derivative([&](double h) { return moved(h).R_BT; }) * at.R_BT.transpose();
    const Vector6 twist = at.J * qd;
    EXPECT_TRUE(near(twist.head<3>(), v, 1e-5));
    EXPECT_TRUE(near(twist.tail<3>(), Eigen::Vector3d(spin(2, 1), spin(0, 2), spin(1, 0)), 1e-5));
    const Vector6 drift = derivative([&](double h) { return (moved(h).J * qd).eval(); });
    EXPECT_TRUE(near(at.Jdot_qd, drift, 1e-6 * std::max(10.0, drift.cwiseAbs().maxCoeff())));
  }
}

/// Potential energy of the chain's masses, from KDL's frames alone.
double potential(const RobotModel& model, const JointVector& q) {
  const KDL::Chain& chain = kdl_chain(model);
  KDL::Frame frame;
  double energy = 0;
  for (int i = 0; i < model.dof(); ++i) {
    const KDL::Segment& segment = chain.getSegment(static_cast<unsigned>(i));
    frame = frame * segment.pose(q[i]);
    const KDL::Vector center = frame * segment.getInertia().getCOG();
    energy -= segment.getInertia().getMass() *
              model.gravity().dot(Eigen::Vector3d(center.x(), center.y(), center.z()));
  }
  return energy;
}

/// Change of energy in 0.2 s less the work of a constant torque, relative to the kinetic energy at
/// the end, by Runge and Kutta in steps of h.
double imbalance(const RobotModel& model, JointVector q, JointVector qd, const JointVector& torque,
                 double h) {
  const auto acceleration = [&](const JointVector& p, const JointVector& v) -> JointVector {
    const DynamicsResult d = evaluate(model, p, v);
    return Eigen::LLT<Eigen::MatrixXd>(d.M).solve(torque - d.coriolis - d.gravity);
  };
  const auto kinetic = [&] { return 0.5 * qd.dot(evaluate(model, q, qd).M * qd); };
  const JointVector start = q;
  const double before = kinetic() + potential(model, q);
  for (int i = 0; i < std::lround(0.2 / h); ++i) {
    const JointVector a = acceleration(q, qd), v2 = qd + h / 2 * a;
    const JointVector b = acceleration(q + h / 2 * qd, v2), v3 = qd + h / 2 * b;
    const JointVector c = acceleration(q + h / 2 * v2, v3), v4 = qd + h * c;
    const JointVector d = acceleration(q + h * v3, v4);
    q += h / 6 * (qd + 2 * v2 + 2 * v3 + v4);
    qd += h / 6 * (a + 2 * b + 2 * c + d);
  }
  const double gain = kinetic() + potential(model, q) - before;
  return std::abs(gain - torque.dot(q - start)) / kinetic();
}

TEST(Dynamics, LetEnergyGrowByTheWorkOfTheTorques) {
  Random random(725);
  for (const RobotModel& model : models()) {
    const int n = model.dof();
    const JointVector q = 0.5 * random.vector(n), qd = 0.5 * random.vector(n);
    const JointVector torque = evaluate(model, q, qd).gravity + 0.1 * random.vector(n);
    const double coarse = imbalance(model, q, qd, torque, 2e-3);
    const double fine = imbalance(model, q, qd, torque, 1e-3);
    EXPECT_LT(fine, 1e-6) << model.name() << n;
    EXPECT_TRUE(fine < coarse / 8 || fine < 1e-10) << coarse << " " << fine;  // of fourth order
  }
}

}  // namespace
}  // namespace dashpot::controller
