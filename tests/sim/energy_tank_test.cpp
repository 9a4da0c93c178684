// The energy that motors give under a tank, against the energy that the simulator counts.
#include <dashpot/tests/support/fed_arm.hpp>

#include <gtest/gtest.h>

#include <cstdio>

namespace dashpot {
namespace {

using testing::FedArm;

constexpr double kExact = 1e-6;  // of the store

TEST(EnergyTank, GivesNoMoreThanItsStoreWhateverThePolicy) {
  constexpr int kPolicies = 30;
  int beyond = 0, weakened = 0, braked = 0;
  for (std::uint64_t seed = 1; seed <= kPolicies; ++seed) {
    SCOPED_TRACE(seed);
    FedArm arm(seed);
    const FedArm::Fed fed = arm.in_stand_in(true);
    EXPECT_LE(fed.most, (1 + kExact) * arm.store);
    weakened += fed.share < 1 ? 1 : 0;
    beyond += arm.in_stand_in(false).most > arm.store ? 1 : 0;
    braked += fed.braked ? 1 : 0;
  }
  std::printf("weakened in %d of %d, beyond the store without the tank %d, braked %d\n", weakened,
              kPolicies, beyond, braked);
  EXPECT_GT(beyond, kPolicies / 3);
  EXPECT_LT(braked, kPolicies / 4);
}

TEST(EnergyTank, GivesNoMoreInMujoco) {
  if (!testing::MujocoArm::available()) GTEST_SKIP() << "no MuJoCo";
  int beyond = 0;
  for (std::uint64_t seed = 101; seed <= 108; ++seed) {
    SCOPED_TRACE(seed);
    FedArm arm(seed);
    EXPECT_LE(arm.in_mujoco(true).most, (1 + kExact) * arm.store);
    beyond += arm.in_mujoco(false).most > arm.store ? 1 : 0;
  }
  EXPECT_GT(beyond, 0);
}

}  // namespace
}  // namespace dashpot
