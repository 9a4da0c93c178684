// Forward dynamics and kinematics against KDL, which computes M, C qd and g in another way.
#include <dashpot/sim/articulated_body.hpp>
#include <dashpot/tests/sim/kdl_chain.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

namespace dashpot::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::ChainFile;
using testing::eigen;
using testing::kdl;
using testing::near;
using testing::Random;

/// What KDL says of one configuration.
struct Reference {
  MatrixXd M, J;
  VectorXd coriolis, gravity;
  KDL::Frame tip;

  Reference(const ChainFile& file, const VectorXd& q, const VectorXd& qd,
            const Eigen::Vector3d& g) {
    const KDL::Chain chain = testing::kdl_chain(file);
    const unsigned n = chain.getNrOfJoints();
    KDL::ChainDynParam dynamics(chain, KDL::Vector(g.x(), g.y(), g.z()));
    KDL::JntSpaceInertiaMatrix mass(static_cast<int>(n));
    KDL::JntArray force(n);
    EXPECT_EQ(dynamics.JntToMass(kdl(q), mass), 0);
    M = eigen(mass);
    EXPECT_EQ(dynamics.JntToCoriolis(kdl(q), kdl(qd), force), 0);
    coriolis = eigen(force);
    EXPECT_EQ(dynamics.JntToGravity(kdl(q), force), 0);
    gravity = eigen(force);
    KDL::Jacobian jacobian(n);
    EXPECT_EQ(KDL::ChainJntToJacSolver(chain).JntToJac(kdl(q), jacobian), 0);
    J = eigen(jacobian);
    EXPECT_EQ(KDL::ChainFkSolverPos_recursive(chain).JntToCart(kdl(q), tip), 0);
  }
};

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
  static double size_of(const Reference& is, const VectorXd& qdd, const VectorXd& tau) {
    return (is.M.cwiseAbs() * qdd.cwiseAbs()).maxCoeff() + is.coriolis.cwiseAbs().maxCoeff() +
           is.gravity.cwiseAbs().maxCoeff() + tau.cwiseAbs().maxCoeff();
  }
};
INSTANTIATE_TEST_SUITE_P(Chains, Dynamics, ::testing::ValuesIn(chains()),
                         [](const auto& instance) { return instance.param.name; });

TEST_P(Dynamics, SatisfyTheEquationOfMotion) {
  Random random(702);
  RobotParameters parameters;
  parameters.gravity = 5 * random.vector(3);
  const Robot robot = testing::robot_of(file(), parameters);
  ArticulatedBody bodies(robot);
  const int n = robot.dof();
  for (int trial = 0; trial < 50; ++trial) {
    const VectorXd q = 2 * random.vector(n), qd = random.vector(n), tau = 20 * random.vector(n);
    const Vector6 wrench = 10 * random.vector(6);
    VectorXd qdd(n);
    bodies.move_to(q.data(), qd.data());
    bodies.push_tip(wrench);
    bodies.accelerations(tau.data(), qdd.data());
    const Reference is(file(), q, qd, parameters.gravity);
    const VectorXd left = is.M * qdd + is.coriolis + is.gravity;
    const VectorXd right = tau + is.J.transpose() * wrench;
    EXPECT_TRUE(near(left, right, 1e-11 * size_of(is, qdd, right)));
  }
}

TEST_P(Dynamics, GiveTheAccelerationsOfTheMassMatrix) {
  Random random(703);
  const Robot robot = testing::robot_of(file());
  ArticulatedBody bodies(robot);
  const int n = robot.dof();
  for (int trial = 0; trial < 50; ++trial) {
    const VectorXd q = 2 * random.vector(n), qd = random.vector(n), tau = 20 * random.vector(n);
    VectorXd qdd(n);
    bodies.move_to(q.data(), qd.data());
    bodies.accelerations(tau.data(), qdd.data());
    const Reference is(file(), q, qd, {0, 0, -9.81});
    const Eigen::LLT<MatrixXd> factors(is.M);
    ASSERT_EQ(factors.info(), Eigen::Success);
    // In coordinates where the mass is 1, so that light joints do not hide behind heavy ones.
    const VectorXd expected = factors.solve(tau - is.coriolis - is.gravity);
    const VectorXd difference = factors.matrixU() * (qdd - expected);
    const double worth = std::max(1e-11, 1e-14 / factors.rcond());  // of the reference
    EXPECT_LT(difference.norm(), worth * (factors.matrixU() * expected).norm());
  }
}

TEST_P(Dynamics, AddArmatureToTheDiagonalOfTheMassMatrix) {
  Random random(704);
  const int n = testing::robot_of(file()).dof();
  RobotParameters parameters;
  parameters.armature = random.vector(n).cwiseAbs();
  const Robot robot = testing::robot_of(file(), parameters);
  ArticulatedBody bodies(robot);
  for (int trial = 0; trial < 20; ++trial) {
    const VectorXd q = 2 * random.vector(n), qd = random.vector(n), tau = 20 * random.vector(n);
    VectorXd qdd(n);
    bodies.move_to(q.data(), qd.data());
    bodies.accelerations(tau.data(), qdd.data());
    Reference is(file(), q, qd, parameters.gravity);
    is.M.diagonal() += parameters.armature;
    const VectorXd left = is.M * qdd + is.coriolis + is.gravity;
    EXPECT_TRUE(near(left, tau, 1e-11 * size_of(is, qdd, tau)));
    EXPECT_NEAR(bodies.kinetic_energy(), 0.5 * qd.dot(is.M * qd), 1e-12 * bodies.kinetic_energy());
  }
}

TEST_P(Dynamics, PlaceTheTip) {
  Random random(705);
  const Robot robot = testing::robot_of(file());
  ArticulatedBody bodies(robot);
  const int n = robot.dof();
  for (int trial = 0; trial < 20; ++trial) {
    const VectorXd q = 2 * random.vector(n), qd = random.vector(n);
    const Vector6 wrench = random.vector(6);
    bodies.move_to(q.data(), qd.data());
    const Reference is(file(), q, qd, robot.gravity());
    const Pose tip = bodies.tip_pose();
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(tip.position[i], is.tip.p[i], 1e-12 * n);
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(tip.rotation(i, j), is.tip.M(i, j), 1e-13 * n);
    }
    EXPECT_TRUE(near(bodies.tip_twist(), is.J * qd, 1e-12 * (1 + (is.J * qd).norm())));
    VectorXd tau(n);
    bodies.transposed_jacobian(wrench, tau.data());
    EXPECT_TRUE(near(tau, is.J.transpose() * wrench, 1e-12 * (1 + tau.norm())));
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
  const Reference is(file(), q, rest, robot.gravity());
  for (int i = 0; i < n; ++i) {
    const VectorXd step = 1e-3 * VectorXd::Unit(n, i);
    const double slope =  // of order 4
        (8 * (energy(q + step) - energy(q - step)) -
         (energy(q + 2 * step) - energy(q - 2 * step))) /
        12e-3;
    EXPECT_NEAR(slope, is.gravity[i], 1e-9 * (1 + std::abs(energy(q)))) << "joint " << i + 1;
  }
}

}  // namespace
}  // namespace dashpot::sim
