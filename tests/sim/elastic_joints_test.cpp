// Arms with elastic joints: motion of two masses on a spring, and conserved quantities. The closed
// loop is in elastic_prediction_test.cpp.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>

namespace dashpot::sim {
namespace {

using Eigen::VectorXd;
using testing::joints;
using testing::precise;
using testing::Random;

constexpr double kRigid = std::numeric_limits<double>::infinity();

/// The slider of 2 kg along z behind a drive of 0.5 kg.
Robot elastic_slider(double stiffness, double damping, double coulomb = 0) {
  const std::string text =
      "<robot name='slider'><link name='a'/><link name='b'><inertial><mass value='2'/>"
      "<inertia ixx='0.1' iyy='0.1' izz='0.1' ixy='0' ixz='0' iyz='0'/></inertial></link>"
      "<joint name='j' type='prismatic'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
      "<limit lower='0' upper='10' effort='0' velocity='0'/></joint></robot>";
  RobotParameters parameters;
  parameters.gravity.setZero();
  parameters.reflected_inertia = joints({0.5});
  parameters.coulomb_friction = joints({coulomb});
  parameters.gear_stiffness = joints({stiffness});
  parameters.gear_damping = joints({damping});
  return Robot::from_text(text, "a", "b", parameters);
}

RobotParameters gears(Eigen::Index n, double stiffness, double damping) {
  RobotParameters parameters;
  parameters.reflected_inertia = JointVector::Constant(n, 0.1);
  parameters.viscous_friction = JointVector::Zero(n);
  parameters.gear_stiffness = JointVector::Constant(n, stiffness);
  parameters.gear_damping = JointVector::Constant(n, damping);
  return parameters;
}

const JointVector kHome = joints({0, -0.7, 0.2, -2.3, 0, 1.5, 0.7});

/// A torque on the drive: the centre of mass accelerates, the spring rings about its deflection.
TEST(ElasticJoint, IsTwoMassesOnASpring) {
  const double K = 4e4, D = 30, B = 0.5, m = 2, tau = 7;
  const double reduced = B * m / (B + m), decay = D / (2 * reduced);
  const double omega = std::sqrt(K / reduced - decay * decay);
  Arm arm(elastic_slider(K, D));
  EXPECT_NEAR(arm.fastest_gear(joints({1})), std::sqrt(K / reduced), 1e-9);
  Plant plant(arm, precise(0.001), joints({1, 0}));
  for (int k = 1; k <= 200; ++k) {
    ASSERT_EQ(plant.step(joints({tau})), Status::kOk);
    const double t = 0.001 * k, rest = tau * reduced / (B * K);
    const double ringing = std::cos(omega * t) + decay / omega * std::sin(omega * t);
    const double deflection = rest * (1 - std::exp(-decay * t) * ringing);
    const double center = 1 + tau / (B + m) * t * t / 2;  // (m q + B theta) / (m + B)
    const double q = center - B / (B + m) * deflection;
    EXPECT_NEAR(plant.state()[1], deflection, 1e-11);
    EXPECT_NEAR(plant.position()[0], q, 1e-10);
    EXPECT_NEAR(plant.measured().position[0], q + deflection, 1e-10);  // the motor's
  }
  EXPECT_NEAR(plant.audit().imbalance(), 0, 1e-10);
  EXPECT_GT(plant.audit().gear_heat, 1e-5);
}

/// Pushed with less than the friction of the drive, the link gives way at once by f / K, and then
/// only as the drive creeps.
TEST(ElasticJoint, HasItsFrictionOnTheMotorsSide) {
  const double K = 1e4, push = 4, coulomb = 10, v_s = 1e-6;
  ArmOptions options;
  options.friction_velocity = v_s;
  options.position_sensor = PositionSensor::kLink;
  options.wrenches = {{0, 10, push * Vector6::Unit(2)}};
  Arm arm(elastic_slider(K, 200, coulomb), options);
  PlantOptions plant_options;
  plant_options.integrator.method = Method::kRosenbrock;
  plant_options.integrator.adaptive = true;
  Plant plant(arm, plant_options, joints({1}));
  ASSERT_EQ(testing::run(plant, 500), Status::kOk);
  const double creep = v_s * std::atanh(push / coulomb);
  EXPECT_NEAR(plant.state()[1], -push / K, 1e-9);
  EXPECT_NEAR(plant.velocity()[0], creep, 1e-3 * creep);
  EXPECT_NEAR(plant.measured().position[0], 1 + push / K + 0.5 * creep, 1e-7);
  EXPECT_NEAR(plant.audit().by_world, push * (plant.position()[0] - 1), 1e-9);
  EXPECT_NEAR(plant.audit().imbalance(), 0, 1e-7);
  EXPECT_EQ(plant.audit().viscous_heat, 0);
}

TEST(ElasticArm, KeepsItsEnergyUnlessSomethingTurnsItToHeat) {
  for (const bool lossless : {true, false}) {
    RobotParameters parameters = gears(7, 2e4, lossless ? 0 : 5);
    if (!lossless) parameters.viscous_friction.setConstant(0.3);
    parameters.gear_stiffness[2] = kRigid;
    Arm arm(testing::robot_of(testing::panda_file(), parameters));
    ASSERT_EQ(arm.coordinates(), 13);
    Random random(3);
    JointVector q(13), qd(13);
    q << kHome, 1e-3 * random.vector(6);
    qd << random.vector(7), 0.3 * random.vector(6);
    Plant plant(arm, precise(0.001), q, qd);
    for (int k = 0; k < 300; ++k) ASSERT_EQ(testing::run(plant, 1), Status::kOk);
    const EnergyAudit audit = plant.audit();
    EXPECT_NEAR(audit.imbalance(), 0, 1e-8);
    EXPECT_NEAR(audit.by_actuators, 0, 0);
    if (lossless) {
      EXPECT_NEAR(audit.stored.sum(), audit.initial.sum(), 1e-8);
      EXPECT_GT(std::abs(audit.stored.springs - audit.initial.springs), 1e-3);
    } else {
      EXPECT_GT(audit.gear_heat, 0.01);
      EXPECT_GT(audit.viscous_heat, 0.01);
    }
  }
}

/// theta - q = g(q) / K, of the link or of the motor at its given start; g by the controller's
/// model.
TEST(ElasticArm, RestsWhereItsGearsCarryTheWeight) {
  const controller::RobotModel model = testing::panda_model();
  for (const PositionSensor sensor : {PositionSensor::kMotor, PositionSensor::kLink}) {
    ArmOptions options;
    options.position_sensor = sensor;
    Arm arm(testing::robot_of(testing::panda_file(), gears(7, 5e3, 0)), options);
    Plant plant(arm, precise(0.001), kHome);
    EXPECT_LT((plant.measured().position - kHome).norm(), 1e-14);
    const JointVector q = plant.position();
    const JointVector weight = controller::evaluate(model, q, JointVector::Zero(7)).gravity;
    const JointVector deflection = plant.state().segment(7, 7);
    EXPECT_LT((5e3 * deflection - weight).norm(), 1e-9);
    EXPECT_GT(deflection.norm(), 4e-3);
    if (sensor == PositionSensor::kLink) EXPECT_EQ(q, kHome);
    for (int k = 0; k < 200; ++k) ASSERT_EQ(plant.step(weight), Status::kOk);
    EXPECT_LT((plant.position() - q).norm(), 1e-11);
    plant.carry(joints({0.1, -0.7, 0.2, -2.3, 0, 1.5, 0.7}), JointVector::Zero(7));
    EXPECT_NEAR(plant.measured().position[0], 0.1, 1e-14);
    EXPECT_NEAR(plant.audit().imbalance(), 0, 1e-9);
  }
}

TEST(ElasticArm, MovesAlikeWithAllIntegrators) {
  DASHPOT_SKIP_IF_QUICK();
  const auto end_of = [](const IntegratorOptions& integrator) {
    ArmOptions arm_options;
    arm_options.wrenches = {{0.0053, 0.0108, 5 * Vector6::Ones()}};
    RobotParameters parameters = gears(7, 1e5, 2);
    parameters.reflected_inertia.setConstant(0.05);
    parameters.coulomb_friction = JointVector::Constant(7, 0.5);
    Arm arm(testing::robot_of(testing::panda_file(), parameters), arm_options);
    PlantOptions options;
    options.integrator = integrator;
    Plant plant(arm, options, kHome);
    for (int k = 0; k < 20; ++k) {
      EXPECT_EQ(plant.step(joints({3, -20, 2, 10, 1, 1, 0.5})), Status::kOk);
    }
    VectorXd state = plant.state().head(28);
    state.tail(14) /= 1000;  // rad/s, of gears with about 1000 rad/s
    return state;
  };
  const VectorXd expected = end_of(precise(0.001).integrator);
  const auto off = [&](Method method, double step, double tolerance) {
    IntegratorOptions options;
    options.method = method;
    options.max_step = step;
    options.adaptive = tolerance > 0;
    if (tolerance > 0) options.absolute_tolerance = options.relative_tolerance = tolerance;
    const double error = (end_of(options) - expected).norm();
    std::printf("%s: %.1e\n", name_of(method).c_str(), error);
    return error;
  };
  EXPECT_LT(off(Method::kDormandPrince8, 0.001, 1e-12), 1e-11);
  EXPECT_LT(off(Method::kRungeKutta4, 5e-6, 0), 1e-10);
  EXPECT_LT(off(Method::kRosenbrock, 0.001, 1e-9), 1e-8);
  EXPECT_LT(off(Method::kImplicitMidpoint, 1e-6, 0), 1e-8);
  EXPECT_LT(off(Method::kSemiImplicitEuler, 1e-7, 0), 1e-6);
}

// ------------------------------------------------------------------------------------- refusals

TEST(ElasticRobot, RefusesGearsThatMakeNoSense) {
  const auto refused = [](int bars, const std::function<void(RobotParameters&)>& change) {
    return testing::refusal<InvalidRobot>([&] { testing::pendulum(bars, change); });
  };
  const auto all = [](double K, double B, int n) {
    return [=](RobotParameters& parameters) {
      parameters.gear_stiffness = JointVector::Constant(n, K);
      parameters.reflected_inertia = JointVector::Constant(n, B);
    };
  };
  EXPECT_EQ(refused(8, all(1e4, 0.1, 8)), "accepted");
  EXPECT_EQ(refused(16, all(kRigid, 0, 16)), "accepted");
  EXPECT_EQ(refused(9, all(1e4, 0.1, 9)),
            "gear_stiffness: joints and elastic gears are 18 coordinates, at most 16 are possible");
  EXPECT_EQ(refused(2, all(1e4, 0.1, 1)),
            "reflected_inertia: has 1 entries, the chain has 2 joints");
  EXPECT_EQ(refused(2, all(1e4, 0, 2)),
            "gear_stiffness of joint 'joint1': needs a reflected_inertia, of the drive");
  for (const double K : {0.0, -1.0, std::nan("")}) {
    EXPECT_EQ(refused(2, all(K, 0.1, 2)),
              "gear_stiffness of joint 'joint1': must be positive, N m/rad; infinite: rigid");
  }
}

}  // namespace
}  // namespace dashpot::sim
