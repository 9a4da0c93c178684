// A mechanism whose motion is known.
#include <dashpot/tests/sim/scenes.hpp>

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

}  // namespace
}  // namespace dashpot::sim
