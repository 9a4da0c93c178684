// Mechanisms whose motion is known.
#include <dashpot/sim/dynamics/articulated_body.hpp>
#include <dashpot/tests/sim/kdl_chain.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>

namespace dashpot::sim {
namespace {

using testing::joints;
using testing::pendulum;
using testing::precise;
using testing::run;

// One bar: (I + m r^2) qdd = -m g r sin q.
const double kOmega = std::sqrt(1.5 * 9.81 * 0.4 / (0.08 + 1.5 * 0.4 * 0.4));

TEST(Pendulum, SwingsSlightlyWithItsNaturalFrequency) {
  Arm arm(pendulum(1));
  const double amplitude = 1e-4;
  Plant plant(arm, precise(0.01), joints({amplitude}));
  for (int i = 1; i <= 500; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    EXPECT_NEAR(plant.position()[0], amplitude * std::cos(kOmega * plant.time()),
                kOmega * 5 * std::pow(amplitude, 3));
  }
}

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

/// With absolute angles a = q1, b = q1 + q2 (Lagrange):
/// (I + m r^2 + m l^2) a'' + m l r cos(a-b) b'' + m l r sin(a-b) b'^2 + (m r + m l) g sin a = 0
/// m l r cos(a-b) a'' + (I + m r^2) b'' - m l r sin(a-b) a'^2 + m g r sin b = 0
TEST(DoublePendulum, AcceleratesByLagrangesEquations) {
  const double m = 1.5, l = 0.8, r = 0.4, I = 0.08, g = 9.81;
  testing::Random random(711);
  const Robot robot = pendulum(2);
  ArticulatedBody bodies(robot);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector2d q = 3 * random.vector(2), qd = 5 * random.vector(2);
    Eigen::Vector2d qdd;
    const Eigen::Vector2d tau = Eigen::Vector2d::Zero();
    bodies.move_to(q.data(), qd.data());
    bodies.accelerations(tau.data(), qdd.data());
    const double a = q[0], b = q[0] + q[1], va = qd[0], vb = qd[0] + qd[1];
    const double coupling = m * l * r * std::cos(a - b), twist = m * l * r * std::sin(a - b);
    const Eigen::Matrix2d M{{I + m * r * r + m * l * l, coupling}, {coupling, I + m * r * r}};
    const Eigen::Vector2d force(-twist * vb * vb - m * (r + l) * g * std::sin(a),
                                twist * va * va - m * g * r * std::sin(b));
    const Eigen::Vector2d expected = M.inverse() * force;
    const double size = 1 + expected.cwiseAbs().maxCoeff() + force.norm();
    EXPECT_NEAR(qdd[0], expected[0], 1e-12 * size);
    EXPECT_NEAR(qdd[0] + qdd[1], expected[1], 1e-12 * size);
  }
}

TEST(DoublePendulum, KeepsItsEnergyWhileItTumbles) {
  Arm arm(pendulum(2));
  Plant plant(arm, precise(0.01), joints({2.5, -1}), joints({1, 3}));
  const double start = plant.audit().stored.sum();
  double least_kinetic = 1e9, most_kinetic = 0;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    const EnergyAudit audit = plant.audit();
    EXPECT_NEAR(audit.stored.sum(), start, 1e-9);
    least_kinetic = std::min(least_kinetic, audit.stored.kinetic);
    most_kinetic = std::max(most_kinetic, audit.stored.kinetic);
  }
  EXPECT_GT(most_kinetic - least_kinetic, 10);  // it did tumble
}

/// Nothing turns the arm about its vertical first axis, so that p1 = (M qd)_1 stays; M by KDL.
TEST(Momentum, AboutTheVerticalIsKept) {
  const testing::ChainFile file = testing::panda_file();
  RobotParameters parameters;
  parameters.viscous_friction = JointVector::Zero(7);
  Arm arm(testing::robot_of(file, parameters));
  testing::KdlReference reference(file, {0, 0, -9.81});
  const auto momentum = [&](const Plant& plant) {
    const JointVector qd = plant.velocity();
    return reference.at(plant.position(), qd).M.row(0).dot(qd);
  };
  Plant plant(arm, precise(0.01), joints({0, -0.7, 0.2, -2.3, 0, 1.5, 0.7}),
              joints({1, 0.3, -0.5, 0.2, 1, -1, 2}));
  const double start = momentum(plant);
  EXPECT_GT(std::abs(start), 0.1);
  const double speed = plant.velocity()[0];
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    EXPECT_NEAR(momentum(plant), start, 1e-9);
  }
  EXPECT_GT(std::abs(plant.velocity()[0] - speed), 0.1);  // though the velocity is not
}

}  // namespace
}  // namespace dashpot::sim
