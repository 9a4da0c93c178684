// The energy that motors give under a tank, against the energy that the simulator counts.
#include <dashpot/controller/law/energy_tank.hpp>
#include <dashpot/tests/support/fed_arm.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <cstdio>

namespace dashpot {
namespace {

using controller::JointVector;
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

TEST(EnergyTank, GainsNothingWhileStatesAreMissing) {
  const controller::RobotModel model = testing::smooth_panda();
  controller::Settings settings = testing::unlimited_settings(model);
  settings.energy = {controller::Energy::From::kTank, 1};
  settings.analysis.sampled.delay = 0;
  controller::EnergyTank tank(model, settings);
  const controller::JointMatrix M = controller::JointMatrix::Identity(7, 7);
  const JointVector none = JointVector::Zero(7), torque = JointVector::Unit(7, 0);
  JointVector q = none;
  const auto level_after = [&](double dq, double dt) {
    q[0] += dq;
    tank.count_work(q, M, none, dt, true);
    tank.apply(torque);
    return tank.level();
  };
  level_after(0, 1e-3);
  EXPECT_NEAR(level_after(0.02, 1e-3), 0.98, 1e-12);
  EXPECT_NEAR(level_after(-0.005, 1e-3), 0.985, 1e-12);
  EXPECT_NEAR(level_after(-0.005, 3e-3), 0.985, 1e-12);
  EXPECT_NEAR(level_after(0.005, 3e-3), 0.98, 1e-12);
}

/// Two arms that are led alike, one with a tank.
class TankedArms : public ::testing::Test {
 protected:
  explicit TankedArms(double store = 0.1) {
    settings.initial.gains.null_stiffness.setZero();
    free = std::make_unique<testing::LedArm>(model, settings);
    settings.energy = {controller::Energy::From::kTank, store};
    tanked = std::make_unique<testing::LedArm>(model, settings);
  }
  template <typename Act>
  void both(const Act& act) {
    act(*free);
    act(*tanked);
  }

  controller::RobotModel model = testing::smooth_panda();
  controller::Settings settings =
      testing::in_mode(testing::unlimited_settings(model), controller::Mode::kCartesian);
  std::unique_ptr<testing::LedArm> free, tanked;
};

TEST_F(TankedArms, PublishTheShareOfTheWrenchThatActs) {
  both([](testing::LedArm& arm) {
    arm.settle();
    arm.place(arm.center + JointVector::Constant(7, 0.02));
    arm.tick();
  });
  const controller::Snapshot &whole = free->controller.snapshot(),
                             &part = tanked->controller.snapshot();
  EXPECT_GT(part.spring_share, 0);
  EXPECT_LT(part.spring_share, 0.97);
  EXPECT_TRUE(testing::near(part.tip_wrench, part.spring_share * whole.tip_wrench, 1e-9));
}

class FullTankedArms : public TankedArms {
 protected:
  FullTankedArms() : TankedArms(1e3) {}
};

/// The weight grows with the body, not with a motion that the tank has to meet ahead.
TEST_F(FullTankedArms, TakeUpABodyLikeOthers) {
  both([](testing::LedArm& arm) {
    arm.settle();
    arm.controller.attach({{.mass = 2}, {}});
  });
  for (int k = 0; k < 600; ++k) {
    both([](testing::LedArm& arm) { arm.tick(); });
    ASSERT_TRUE(testing::near(tanked->torque, free->torque, 1e-9)) << k;
  }
}

}  // namespace
}  // namespace dashpot
