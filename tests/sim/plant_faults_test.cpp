// Sensors that fail, and hands that move a robot.
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace dashpot::sim {
namespace {

using testing::joints;
using testing::kOne;
using testing::kZero;
using testing::LinearSystem;
using testing::run;

/// Returns the measurement at tick 5 of a mass that moves with 2 m/s from 1 m on, with a fault from
/// tick 3 to 8.
Measurement shown(SensorFault fault, int ticks, bool difference = false) {
  LinearSystem mass(kOne, kZero, kZero);
  PlantOptions options;
  fault.begin = 0.003;
  fault.end = 0.008;
  options.faults = {fault};
  options.difference_velocity = difference;
  Plant plant(mass, options, joints({1}), joints({2}));
  EXPECT_EQ(run(plant, ticks), Status::kOk);
  EXPECT_NEAR(plant.position()[0], 1 + 0.002 * ticks, 1e-12);
  return plant.measured();
}

TEST(SensorFaults, ShiftPositionsBeforeTheyAreDifferenced) {
  SensorFault fault;
  fault.position_offset = joints({-5});
  EXPECT_NEAR(shown(fault, 2).position[0], 1.004, 1e-12);
  EXPECT_NEAR(shown(fault, 3).position[0], -3.994, 1e-12);
  EXPECT_NEAR(shown(fault, 7).position[0], -3.986, 1e-12);
  EXPECT_NEAR(shown(fault, 8).position[0], 1.016, 1e-12);
  EXPECT_NEAR(shown(fault, 3).velocity[0], 2, 1e-12);
  EXPECT_NEAR(shown(fault, 3, true).velocity[0], 2 - 5000, 1e-9);
  EXPECT_NEAR(shown(fault, 4, true).velocity[0], 2, 1e-9);
}

TEST(SensorFaults, ScaleVelocities) {
  SensorFault fault;
  fault.velocity_factor = joints({-0.5});
  EXPECT_EQ(shown(fault, 2).velocity[0], 2);
  EXPECT_EQ(shown(fault, 3).velocity[0], -1);
  EXPECT_EQ(shown(fault, 8).velocity[0], 2);
}

TEST(SensorFaults, FreezeWhatWasShown) {
  SensorFault fault;
  fault.frozen = true;
  EXPECT_NEAR(shown(fault, 7).position[0], 1.004, 1e-12);
  EXPECT_EQ(shown(fault, 7).velocity[0], 2);
  EXPECT_EQ(shown(fault, 7).time, 7000000);
  EXPECT_NEAR(shown(fault, 8).position[0], 1.016, 1e-12);
}

TEST(SensorFaults, SpoilNumbersAndTheClock) {
  SensorFault fault;
  fault.not_a_number = true;
  fault.clock_offset = -1000;
  EXPECT_TRUE(std::isnan(shown(fault, 5).position[0]));
  EXPECT_EQ(shown(fault, 5).velocity[0], 2);
  EXPECT_EQ(shown(fault, 5).time, 4999000);
  EXPECT_EQ(shown(fault, 8).time, 8000000);
}

TEST(SensorFaults, AreRefusedWhereTheyMakeNoSense) {
  LinearSystem mass(kOne, kZero, kZero);
  for (const auto field : {&SensorFault::velocity_factor, &SensorFault::position_offset}) {
    PlantOptions options;
    options.faults.resize(1);
    for (const auto& wrong : {joints({1, 1}), joints({std::nan("")})}) {
      options.faults[0].*field = wrong;
      EXPECT_THROW(Plant(mass, options, joints({0})), InvalidScene);
    }
    options.faults[0].*field = joints({1});
    EXPECT_NO_THROW(Plant(mass, options, joints({0})));
    options.faults[0].end = 0;
    EXPECT_THROW(Plant(mass, options, joints({0})), InvalidScene);
  }
}

TEST(Plant, IsCarriedByAHandThatDoesTheWork) {
  LinearSystem mass(2 * kOne, kZero, 40 * kOne);
  Plant plant(mass, {}, joints({0}));
  plant.carry(joints({0.5}), joints({3}));
  EXPECT_EQ(plant.measured().time, 1000000);
  EXPECT_EQ(plant.measured().position[0], 0.5);
  EXPECT_EQ(plant.measured().velocity[0], 3);
  EXPECT_NEAR(plant.audit().by_world, 0.5 * 2 * 9 + 0.5 * 40 * 0.25, 1e-12);
  EXPECT_NEAR(plant.audit().imbalance(), 0, 1e-12);
  ASSERT_EQ(run(plant, 1), Status::kOk);
  EXPECT_NEAR(plant.position()[0], 0.503, 1e-4);
}

}  // namespace
}  // namespace dashpot::sim
