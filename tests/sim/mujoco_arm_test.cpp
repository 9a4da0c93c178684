// Another engine against sim::Arm: the same accelerations, and motions; and its own dry friction
// and stops. Skipped if the build has no MuJoCo.
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/mujoco_arm.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace dashpot::testing {
namespace {

using Eigen::Vector3d;
using sim::JointVector;
using sim::StateVector;

class MujocoPlant : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!MujocoArm::available()) GTEST_SKIP() << "no MuJoCo (Debian: libmujoco-dev)";
  }
  JointVector random(Eigen::Index n, double size) {
    return JointVector::NullaryExpr(n, [&] { return dice.uniform(-size, size); });
  }
  /// Rotors, friction, a tilted base, a payload.
  sim::Robot robot(const Arm& arm) {
    sim::RobotParameters parameters;
    const int n = sim::Robot::from_file(arm_path(arm.file), arm.base, arm.tip).dof();
    parameters.reflected_inertia = random(n, 0.1).cwiseAbs();
    parameters.viscous_friction = random(n, 5).cwiseAbs();
    parameters.gravity = {2, -3, -8};
    parameters.payload = body(1.5);
    return sim::Robot::from_file(arm_path(arm.file), arm.base, arm.tip, parameters);
  }
  static sim::Inertia body(double mass) {
    Eigen::Matrix3d about_center;
    about_center << 4, 1, 0, 1, 5, -1, 0, -1, 3;
    return {mass, {0.02, -0.01, 0.06}, 1e-3 * about_center};
  }

  Dice dice{53};
};

JointVector acceleration(sim::Arm& arm, const JointVector& q, const JointVector& qd,
                         const JointVector& torque) {
  StateVector y = StateVector::Zero(2 * q.size() + sim::kWorkChannels), y_dot = y;
  arm.place(q, qd, y);
  arm.set_torque(torque);
  arm.begin_segment(0);
  arm.rates(y, y_dot);
  return y_dot.segment(q.size(), q.size());
}

TEST_F(MujocoPlant, HasTheAccelerationsOfTheStandIn) {
  std::vector<Arm> arms = all_arms();
  arms.insert(arms.end(), {{"ur10e", "base_link", "tool0"}, {"lift_gripper", "base", "fingertip"}});
  for (const Arm& name : arms) {
    SCOPED_TRACE(name);
    const sim::Robot robot = this->robot(name);
    sim::ArmOptions world;
    world.coulomb_friction = false;
    sim::Vector6 wrench;
    wrench << 10, -20, 30, 1, -2, 3;
    world.wrenches = {{0, 1, wrench}};
    world.wall.emplace();  // which every second arm touches
    const JointVector q = random(robot.dof(), 1), qd = random(robot.dof(), 1);
    world.wall->point = sim::Arm(robot).tip_pose(q).position;
    world.wall->point.z() += dice.uniform(-0.02, 0.02);
    world.wall->contact.damping = 10;
    sim::Arm ours(robot, world);
    const auto theirs = MujocoArm::make(robot, world, {}, q, qd);
    const JointVector torque = random(robot.dof(), 50);
    const JointVector expected = acceleration(ours, q, qd, torque);
    EXPECT_LT((theirs->acceleration(torque) - expected).norm(), 1e-9 * expected.norm());
    EXPECT_LT((theirs->tip_pose().position - ours.tip_pose(q).position).norm(), 1e-12);
    EXPECT_LT((theirs->tip_pose().rotation - ours.tip_pose(q).rotation).norm(), 1e-12);
    EXPECT_LT((theirs->tip_twist() - ours.tip_twist(q, qd)).norm(), 1e-11);
    StateVector y = StateVector::Zero(2 * q.size() + sim::kWorkChannels);
    ours.place(q, qd, y);
    const double energy = ours.stored_energy(y).kinetic;
    EXPECT_NEAR(theirs->kinetic_energy(), energy, 1e-10 * energy);
  }
}

/// Masses and moments of 1.1 move as before with 1.1 of the torque; a payload of the options is one
/// of the robot's; a push on the last body is a wrench on the tip.
TEST_F(MujocoPlant, WeighsAndPushesWhatItIsGiven) {
  const Arm name = arms()[1];
  sim::RobotParameters parameters;
  parameters.viscous_friction = parameters.coulomb_friction = JointVector::Zero(7);
  const sim::Robot robot =
      sim::Robot::from_file(arm_path(name.file), name.base, name.tip, parameters);
  const JointVector q = random(7, 1), qd = random(7, 1), torque = random(7, 50);
  const auto same = [&](const JointVector& a, const JointVector& b) {
    EXPECT_LT((a - b).norm(), 1e-9 * b.norm());
  };
  sim::Arm ours(robot);
  MujocoOptions options;
  options.link_factor = 1.1;
  const JointVector expected = acceleration(ours, q, qd, torque);
  same(MujocoArm::make(robot, {}, options, q, qd)->acceleration(1.1 * torque), expected);

  sim::Robot loaded = robot;
  loaded.carry(body(3));
  sim::Arm ours_loaded(loaded);
  options.link_factor = 1;
  options.payload = body(3);
  const auto theirs = MujocoArm::make(robot, {}, options, q, qd);
  same(theirs->acceleration(torque), acceleration(ours_loaded, q, qd, torque));

  const Vector3d force(30, -40, 20);
  sim::Vector6 wrench = sim::Vector6::Zero();
  wrench.head<3>() = force;
  sim::ArmOptions world;
  world.wrenches = {{0, 1, wrench}};
  sim::Arm pushed(loaded, world);
  theirs->push(6, robot.tip().position, force);
  same(theirs->acceleration(torque), acceleration(pushed, q, qd, torque));
  theirs->push(6, robot.tip().position, Vector3d::Zero());
  same(theirs->acceleration(torque), acceleration(ours_loaded, q, qd, torque));
}

/// Thrown and left to swing, with a torque that comes two steps late.
TEST_F(MujocoPlant, MovesAsTheStandInDoes) {
  const sim::Robot robot = this->robot(arms()[0]);
  sim::ArmOptions world;
  world.coulomb_friction = false;
  JointVector q(7), qd(7);
  q << 0, -0.8, 0, -2.4, 0, 1.6, 0.8;
  qd << 1, -1, 0.5, 1, -0.5, 1, 2;
  sim::Arm arm(robot, world);
  sim::PlantOptions options;
  options.delay = 2;
  options.initial_torque = JointVector::Constant(7, 2);
  sim::Plant plant(arm, options, q, qd);
  MujocoOptions mujoco;
  mujoco.step = 5e-5;  // its integrator is of first order
  mujoco.delay = 2;
  const auto theirs = MujocoArm::make(robot, world, mujoco, q, qd);
  theirs->step(options.initial_torque, 1e-3);  // fills the delay with it
  ASSERT_EQ(plant.step(options.initial_torque), sim::Status::kOk);
  for (int i = 1; i < 500; ++i) {
    const JointVector torque = JointVector::Constant(7, 2 + 8 * std::sin(0.03 * i));
    theirs->step(torque, 1e-3);
    ASSERT_EQ(plant.step(torque), sim::Status::kOk);
  }
  EXPECT_NEAR(theirs->time(), plant.time(), 1e-12);
  EXPECT_LT((theirs->position() - plant.position()).norm(), 5e-4);
  EXPECT_GT((theirs->position() - q).norm(), 0.3);
}

/// 2 kg on a slide with 4 N of friction: 3 N do not move it, 6 N do with 1 m/s^2.
TEST_F(MujocoPlant, SticksUntilItIsPushedHarder) {
  const auto arm = MujocoArm::make(slider(Vector3d::Zero(), 0, 4), {}, {}, joints({5}));
  for (int i = 0; i < 1000; ++i) arm->step(joints({3}), 1e-3);
  EXPECT_LT(std::abs(arm->position()[0] - 5), 1e-6);
  for (int i = 0; i < 1000; ++i) arm->step(joints({6}), 1e-3);
  EXPECT_NEAR(arm->velocity()[0], 1, 1e-3);
  EXPECT_NEAR(arm->position()[0], 5.5, 1e-3);
}

TEST_F(MujocoPlant, StopsAtItsLimits) {
  sim::ArmOptions world;
  const auto rest = [&] {
    const auto arm = MujocoArm::make(slider({0, 0, 9.81}, 2), world, {}, joints({9}));
    for (int i = 0; i < 2000; ++i) arm->step(joints({0}), 1e-3);
    return arm->position()[0];
  };
  EXPECT_GT(rest(), 15);
  world.stops.emplace();
  EXPECT_NEAR(rest(), 10, 1e-3);
}

}  // namespace
}  // namespace dashpot::testing
