// Forward dynamics and kinematics against KDL, which computes M, C qd and g in another way.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/sim/dynamics/articulated_body.hpp>
#include <dashpot/tests/sim/kdl_chain.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

namespace dashpot::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::ChainFile;
using testing::KdlReference;
using testing::near;
using testing::Random;
using Terms = testing::KdlReference::Terms;

/// The four arms, and chains made up of every length.
std::vector<ChainFile> chains() {
  std::vector<ChainFile> all = testing::arm_files();
  Random random(701);
  for (int n = 1; n <= kMaxJoints; ++n) all.push_back(testing::random_chain(random, n));
  return all;
}

class Dynamics : public ::testing::TestWithParam<ChainFile> {
 protected:
  const ChainFile& file() const { return GetParam(); }
  /// Forces of the equation of motion are this large.
  static double size_of(const Terms& is, const VectorXd& qdd, const VectorXd& tau) {
    return (is.M.cwiseAbs() * qdd.cwiseAbs()).maxCoeff() + is.coriolis.cwiseAbs().maxCoeff() +
           is.gravity.cwiseAbs().maxCoeff() + tau.cwiseAbs().maxCoeff();
  }
};
INSTANTIATE_TEST_SUITE_P(Chains, Dynamics, ::testing::ValuesIn(chains()),
                         [](const auto& instance) { return instance.param.name; });

TEST_P(Dynamics, AreThoseOfTheMassMatrix) {
  Random random(702);
  const int n = testing::robot_of(file()).dof();
  for (const bool reflected : {false, true}) {
    RobotParameters parameters;
    parameters.gravity = 5 * random.vector(3);
    if (reflected) parameters.reflected_inertia = random.vector(n).cwiseAbs();
    const Robot robot = testing::robot_of(file(), parameters);
    ArticulatedBody bodies(robot);
    KdlReference reference(file(), robot.gravity());
    for (int trial = 0; trial < 40; ++trial) {
      const VectorXd q = 2 * random.vector(n), qd = random.vector(n), tau = 20 * random.vector(n);
      const Vector6 wrench = (trial % 2) * 10 * random.vector(6);
      VectorXd qdd(n), pulled(n);
      bodies.move_to(q.data(), qd.data());
      if (trial % 2 == 1) bodies.push_tip(wrench);
      bodies.accelerations(tau.data(), qdd.data());
      Terms is = reference.at(q, qd);
      if (reflected) is.M.diagonal() += parameters.reflected_inertia;
      const VectorXd force = tau + is.J.transpose() * wrench - is.coriolis - is.gravity;
      EXPECT_TRUE(near(is.M * qdd, force, 1e-11 * size_of(is, qdd, tau)));
      EXPECT_NEAR(bodies.kinetic_energy(), 0.5 * qd.dot(is.M * qd),
                  1e-12 * bodies.kinetic_energy());
      // In coordinates where the mass is 1, so that light joints do not hide behind heavy ones.
      const Eigen::LLT<MatrixXd> factors(is.M);
      ASSERT_EQ(factors.info(), Eigen::Success);
      const VectorXd expected = factors.solve(force);
      const double worth = std::max(1e-11, 1e-14 / factors.rcond());  // of the reference
      EXPECT_LT((factors.matrixU() * (qdd - expected)).norm(),
                worth * (factors.matrixU() * expected).norm());
      const Pose tip = bodies.tip_pose();
      EXPECT_TRUE(near(tip.position, is.tip_position, 1e-12 * n));
      EXPECT_TRUE(near(tip.rotation, is.tip_rotation, 1e-13 * n));
      EXPECT_TRUE(near(bodies.tip_twist(), is.J * qd, 1e-12 * (1 + (is.J * qd).norm())));
      bodies.transposed_jacobian(wrench, pulled.data());
      EXPECT_TRUE(near(pulled, is.J.transpose() * wrench, 1e-12 * (1 + pulled.norm())));
    }
  }
}

TEST_P(Dynamics, FallDownTheGradientOfTheGravityEnergy) {
  Random random(706);
  const Robot robot = testing::robot_of(file());
  ArticulatedBody bodies(robot);
  const int n = robot.dof();
  const VectorXd rest = VectorXd::Zero(n);
  const auto energy = [&](const VectorXd& q) {
    bodies.move_to(q.data(), rest.data());
    return bodies.gravity_energy();
  };
  const VectorXd q = random.vector(n);
  const Terms is = KdlReference(file(), robot.gravity()).at(q, rest);
  for (int i = 0; i < n; ++i) {
    const VectorXd step = 1e-3 * VectorXd::Unit(n, i);
    const double slope =  // of order 4
        (8 * (energy(q + step) - energy(q - step)) -
         (energy(q + 2 * step) - energy(q - 2 * step))) /
        12e-3;
    EXPECT_NEAR(slope, is.gravity[i], 1e-9 * (1 + std::abs(energy(q)))) << "joint " << i + 1;
  }
}

/// The controller's own model of the same file: without friction they must agree, without KDL
/// between them.
TEST_P(Dynamics, UndoWhatTheModelOfTheControllerAsksFor) {
  Random random(707);
  const int n = testing::robot_of(file()).dof();
  controller::ModelOptions options;
  options.gravity = 5 * random.vector(3);
  options.reflected_inertia = random.vector(n).cwiseAbs();
  options.payload.mass = 1.5;
  options.payload.center = {0.05, -0.02, 0.1};
  options.payload.inertia = testing::RandomRobot(random.engine()()).inertia(1.5, 0.05);
  RobotParameters parameters;
  parameters.gravity = options.gravity;
  parameters.reflected_inertia = options.reflected_inertia;
  parameters.payload = {1.5, options.payload.center, options.payload.inertia};
  const controller::RobotModel model =
      controller::RobotModel::from_urdf_text(file().urdf, file().base, file().tip, options);
  const Robot robot = testing::robot_of(file(), parameters);
  ArticulatedBody bodies(robot);
  for (int trial = 0; trial < 50; ++trial) {
    const VectorXd q = 2 * random.vector(n), qd = random.vector(n), qdd = 5 * random.vector(n);
    const Vector6 wrench = 10 * random.vector(6);
    const controller::DynamicsResult is = controller::evaluate(model, q, qd);
    const VectorXd tau = is.M * qdd + is.coriolis + is.gravity - is.J.transpose() * wrench;
    VectorXd result(n);
    bodies.move_to(q.data(), qd.data());
    bodies.push_tip(wrench);
    bodies.accelerations(tau.data(), result.data());
    const VectorXd missing = is.M * (result - qdd);
    const double size = (is.M.cwiseAbs() * qdd.cwiseAbs()).maxCoeff() + tau.cwiseAbs().maxCoeff();
    EXPECT_TRUE(near(missing, VectorXd::Zero(n), 1e-11 * size));
  }
}

}  // namespace
}  // namespace dashpot::sim
