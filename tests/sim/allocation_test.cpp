// Once set up, neither a step of the plant nor the dynamics in it touches the heap.
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/count_allocations.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace dashpot::sim {
namespace {

using testing::allocations_of;
using testing::joints;
using testing::LinearSystem;

/// A loop over every feature, with a command that fails in between.
void expect_no_allocation(System& system, PlantOptions options, const JointVector& start) {
  const Eigen::Index n = start.size();
  options.torque_limit = JointVector::Constant(n, 50);
  options.delay = 2;
  options.torque_cutoff = 100;
  options.position_noise = JointVector::Constant(n, 1e-5);
  options.velocity_noise = JointVector::Constant(n, 1e-5);
  options.position_resolution = JointVector::Constant(n, 1e-5);
  SensorFault fault;
  fault.begin = 0.05;
  fault.position_offset = fault.velocity_factor = JointVector::Constant(n, 0.5);
  fault.frozen = true;
  options.faults = {fault};
  for (const bool difference : {false, true}) {
    options.difference_velocity = difference;
    for (const Method method : testing::kMethods) {
      for (const bool adaptive : {false, true}) {
        options.integrator.method = method;
        options.integrator.adaptive = adaptive && estimates_error(method);
        Plant plant(system, options, start);
        JointVector torque = JointVector::Constant(n, 3);
        const JointVector bad = JointVector::Constant(n, std::nan(""));
        Status status = Status::kOk, refused = Status::kOk;
        EnergyAudit audit;
        EXPECT_EQ(allocations_of([&] {
                    for (int i = 0; i < 200 && status == Status::kOk; ++i) {
                      torque = -20 * plant.measured().velocity;
                      status = plant.step(torque);
                      refused = plant.step(bad);
                      audit = plant.audit();
                      if (i % 50 == 0) plant.carry(plant.position(), plant.velocity());
                    }
                  }),
                  0)
            << "method " << name_of(method) << ", adaptive " << adaptive;
        EXPECT_EQ(status, Status::kOk);
        EXPECT_EQ(refused, Status::kCommandNotFinite);
      }
    }
  }
}

TEST(Allocation, DoesNotHappenInAStepOfAnArm) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_GE(allocations_of([] { ::operator delete(::operator new(100)); }), 1);
  const testing::ChainFile file = testing::panda_file();
  RobotParameters parameters;
  parameters.reflected_inertia = JointVector::Constant(7, 0.2);
  parameters.coulomb_friction = JointVector::Constant(7, 0.3);
  const JointVector home = joints({0, -0.7, 0.2, -2.3, 0, 1.5, 0.7});
  ArmOptions options;
  options.stops = Contact{1000, 5};
  options.wrenches = {{0.0105, 0.0303, 10 * Vector6::Ones()}};
  Arm free(testing::robot_of(file, parameters));
  options.wall = Wall{free.tip_pose(home).position - Eigen::Vector3d(0, 0, 0.005), {0, 0, 1}, {}};
  options.wall->contact = Contact{1e4, 50};
  Arm arm(testing::robot_of(file, parameters), options);
  expect_no_allocation(arm, {}, home);
  parameters.gear_stiffness = JointVector::Constant(7, 2000);
  parameters.gear_damping = JointVector::Constant(7, 2);
  Arm elastic(testing::robot_of(file, parameters), options);
  expect_no_allocation(elastic, {}, home);
}

TEST(Allocation, DoesNotHappenInAStepOfALinearSystem) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  const testing::Chain3 chain;
  LinearSystem system(chain.M, chain.C, chain.K, {{0.0105, 0.0303, joints({1, 2, 3})}});
  expect_no_allocation(system, {}, joints({0, 0.03, 0}));
}

}  // namespace
}  // namespace dashpot::sim
