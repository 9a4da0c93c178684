// Mechanisms whose motion is known.
#include <dashpot/tests/sim/kdl_chain.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace dashpot::sim {
namespace {

using testing::joints;
using testing::pendulum;
using testing::precise;
using testing::run;

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
