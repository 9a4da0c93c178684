// Forward dynamics and kinematics against the controller's model of the same file, which computes
// M, C qd and g in another way; tests/controller compares that with KDL.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/sim/dynamics/articulated_body.hpp>
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

namespace dashpot::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::ChainFile;
using testing::joints;
using testing::near;
using testing::pendulum;
using testing::precise;
using testing::Random;
using testing::run;

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
  controller::RobotModel model(const controller::ModelOptions& options = {}) const {
    return controller::RobotModel::from_urdf_text(file().urdf, file().base, file().tip, options);
  }
};
INSTANTIATE_TEST_SUITE_P(Chains, Dynamics, ::testing::ValuesIn(chains()),
                         [](const auto& instance) { return instance.param.name; });

TEST_P(Dynamics, AreThoseOfTheModelOfTheController) {
  Random random(702);
  const int n = testing::robot_of(file()).dof();
  for (const bool loaded : {false, true}) {
    controller::ModelOptions options;
    options.gravity = 5 * random.vector(3);
    RobotParameters parameters;
    if (loaded) {
      options.reflected_inertia = random.vector(n).cwiseAbs();
      options.payload.mass = 1.5;
      options.payload.center = {0.05, -0.02, 0.1};
      options.payload.inertia = testing::RandomRobot(random.engine()()).inertia(1.5, 0.05);
      parameters.payload = {1.5, options.payload.center, options.payload.inertia};
    }
    parameters.gravity = options.gravity;
    parameters.reflected_inertia = options.reflected_inertia;
    const controller::RobotModel reference = model(options);
    const Robot robot = testing::robot_of(file(), parameters);
    ArticulatedBody bodies(robot);
    for (int trial = 0; trial < 40; ++trial) {
      const VectorXd q = 2 * random.vector(n), qd = random.vector(n), tau = 20 * random.vector(n);
      const Vector6 wrench = (trial % 2) * 10 * random.vector(6);
      VectorXd qdd(n);
      bodies.move_to(q.data(), qd.data());
      if (trial % 2 == 1) bodies.push_tip(wrench);
      bodies.accelerations(tau.data(), qdd.data());
      const controller::DynamicsResult is = controller::evaluate(reference, q, qd);
      const VectorXd pull = is.J.transpose() * wrench;
      const VectorXd force = tau + pull - is.coriolis - is.gravity;
      const double size = (is.M.cwiseAbs() * qdd.cwiseAbs()).maxCoeff() +
                          is.coriolis.cwiseAbs().maxCoeff() + is.gravity.cwiseAbs().maxCoeff() +
                          tau.cwiseAbs().maxCoeff();
      EXPECT_TRUE(near(VectorXd(is.M * qdd), force, 1e-11 * size));
      EXPECT_NEAR(bodies.kinetic_energy(), 0.5 * qd.dot(is.M * qd),
                  1e-12 * bodies.kinetic_energy());
      // In coordinates where the mass is 1, so that light joints do not hide behind heavy ones.
      const Eigen::LLT<MatrixXd> factors(MatrixXd(is.M));
      ASSERT_EQ(factors.info(), Eigen::Success);
      const VectorXd expected = factors.solve(force);
      const double worth = std::max(1e-11, 1e-14 / factors.rcond());  // of the reference
      EXPECT_LT((factors.matrixU() * (qdd - expected)).norm(),
                worth * (factors.matrixU() * expected).norm());
      const Pose tip = bodies.tip_pose();
      EXPECT_TRUE(near(tip.position, is.p_BT_B, 1e-12 * n));
      EXPECT_TRUE(near(tip.rotation, is.R_BT, 1e-13 * n));
      const Vector6 twist = is.J * qd;
      EXPECT_TRUE(near(bodies.tip_twist(), twist, 1e-12 * (1 + twist.norm())));
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
  const VectorXd gravity = controller::evaluate(model(), q, rest).gravity;
  for (int i = 0; i < n; ++i) {
    const VectorXd step = 1e-3 * VectorXd::Unit(n, i);
    const double slope =  // of order 4
        (8 * (energy(q + step) - energy(q - step)) -
         (energy(q + 2 * step) - energy(q - 2 * step))) /
        12e-3;
    EXPECT_NEAR(slope, gravity[i], 1e-9 * (1 + std::abs(energy(q)))) << "joint " << i + 1;
  }
}

// A mechanism whose motion is known.

// One bar: (I + m r^2) qdd = -m g r sin q.
const double kOmega = std::sqrt(1.5 * 9.81 * 0.4 / (0.08 + 1.5 * 0.4 * 0.4));

/// Period 4 K(sin(a/2)) / omega with the complete elliptic integral of the first kind.
TEST(Pendulum, SwingsFarWithThePeriodOfTheEllipticIntegral) {
  for (const double amplitude : {0.5, 1.5, 3.0}) {
    const double period = 4 * std::comp_ellint_1(std::sin(amplitude / 2)) / kOmega;
    Arm arm(pendulum(1));
    Plant plant(arm, precise(period / 400), joints({amplitude}));
    ASSERT_EQ(run(plant, 100), Status::kOk);
    EXPECT_NEAR(plant.position()[0], 0, 1e-10);
    EXPECT_NEAR(plant.velocity()[0], -2 * kOmega * std::sin(amplitude / 2), 1e-10);
    ASSERT_EQ(run(plant, 100), Status::kOk);
    EXPECT_NEAR(plant.position()[0], -amplitude, 1e-10);
    ASSERT_EQ(run(plant, 200), Status::kOk);
    EXPECT_NEAR(plant.position()[0], amplitude, 1e-9);
    EXPECT_NEAR(plant.velocity()[0], 0, 1e-9);
  }
}

}  // namespace
}  // namespace dashpot::sim
