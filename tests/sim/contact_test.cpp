// The stable contact stiffness of a loop, against plants in simulation: the growth of a touch on
// both sides of the limit shows where it changes sign.
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/tests/support/linear_system.hpp>
#include <dashpot/tests/support/mujoco_arm.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/twin_models.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace dashpot {
namespace {

using controller::JointVector;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;

/// Gains, rotors and a loop drawn by chance for a Panda whose gravity the robot itself holds.
struct TouchedPanda {
  controller::AuditOptions stated;
  JointVector inertia, q;
  std::optional<JointVector> gears;

  TouchedPanda(Random& random, int delay, bool elastic) {
    stated.period = 1e-3;
    stated.delay = delay;
    stated.ideal_gravity = true;
    stated.cutoff = random.integer(0, 1) * random.log_uniform(100, 400);
    stated.difference_velocity = random.integer(0, 1) == 1;
    VectorXd K(6);
    K << VectorXd::Constant(3, random.log_uniform(100, 1000)),
        VectorXd::Constant(3, random.log_uniform(10, 50));
    stated.gains.task_stiffness = K.asDiagonal();
    stated.gains.task_damping = (random.uniform(1, 1.5) * K.cwiseSqrt()).asDiagonal();
    stated.gains.null_damping = JointVector::Constant(7, 1);
    inertia = JointVector::Constant(7, random.log_uniform(0.2, 0.6));
    if (elastic) gears = JointVector::Constant(7, random.log_uniform(8e3, 3e4));
    q = testing::random_posture(testing::TwinModels(testing::arms()[0]), random);
  }
  controller::RobotModel model() const {
    controller::ModelOptions options;
    options.reflected_inertia = inertia;
    options.viscous_friction = JointVector::Zero(7);
    if (gears) options.gear_stiffness = *gears;
    return testing::arm_model(testing::arms()[0], options);
  }
  sim::Robot robot() const {
    sim::RobotParameters parameters;
    parameters.reflected_inertia = inertia;
    parameters.viscous_friction = JointVector::Zero(7);
    parameters.gravity.setZero();
    const testing::Arm& arm = testing::arms()[0];
    return sim::Robot::from_file(testing::arm_path(arm.file), arm.base, arm.tip, parameters);
  }
};

/// Growth a tick of a fast motion, from the positions of step(): the change of the size of its
/// second differences, which slow motions hardly have.
template <class Step>
double growth_rate(int ticks, const Step& step) {
  double before[2] = {step(), step()}, sizes[2] = {0, 0};
  const int third = ticks / 3;
  for (int k = 0; k < 3 * third; ++k) {
    const double now = step(), bend = now - 2 * before[1] + before[0];
    before[0] = before[1], before[1] = now;
    if (k >= third) sizes[k / third - 1] += bend * bend;
  }
  return 0.5 * std::log(sizes[1] / sizes[0]) / third;
}

/// The stiffness where growth(k) changes sign, between slightly less and slightly more than the
/// limit found, by a straight line. Expects no growth below and growth above.
template <class Growth>
void expect_turn(double limit, const Growth& growth) {
  constexpr double kAside = 0.05;
  const double below = growth((1 - kAside) * limit), above = growth((1 + kAside) * limit);
  EXPECT_LT(below, 0);
  EXPECT_GT(above, 0);
  const double turn = 1 + kAside * (above + below) / (below - above);
  EXPECT_NEAR(turn, 1, 0.01) << "a limit of " << limit;
}

/// Seven joints, rigid and elastic, as masses on springs.
TEST(Contact, MassesTurnWhereTheLimitIs) {
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    Random random(seed);
    const TouchedPanda panda(random, static_cast<int>(seed % 5), seed % 2 == 0);
    const controller::Audit audit(panda.model(), panda.stated);
    controller::ContactOptions options;
    options.direction = random.vector(3).normalized();
    const analysis::ContactLimit limit = find_contact(audit, panda.q, options).limit;
    if (limit.stiffness == 0) continue;  // it rings in the air
    ASSERT_TRUE(std::isfinite(limit.stiffness));
    const controller::LoopAt at = audit.at(panda.q);
    const analysis::System<>& system = at.system;
    const analysis::SampledLoop& loop = at.sampled;
    const auto robot = evaluate(audit.model(), panda.q, JointVector::Zero(7));
    VectorXd a = VectorXd::Zero(system.dof());
    a.head(7) = robot.J.topRows<3>().transpose() * *options.direction;
    const auto or_zero = [&](const MatrixXd& A) {
      return A.size() > 0 ? A : MatrixXd::Zero(a.size(), a.size());
    };
    const MatrixXd D = or_zero(loop.friction), P = or_zero(loop.passive_stiffness);
    const MatrixXd K = system.stiffness - P, C = system.damping - D;
    options.direction->normalize();
    const std::vector<double> beyond = {1.05 * limit.stiffness};
    const analysis::ContactPoint point = contact_curve(audit, panda.q, options, beyond)[0];
    const double rate = -point.damping_ratio * point.natural_frequency * loop.period;
    if (rate < 2e-5) continue;  // too slow to be seen
    expect_turn(limit.stiffness, [&](double k) {
      testing::LinearSystem masses(system.mass, D, P + k * a * a.transpose());
      auto drives = testing::plant_options(loop);
      drives.integrator.max_step = 0.05 * loop.period;
      sim::Plant plant(masses, drives, 1e-3 * system.mass.llt().solve(a));
      return growth_rate(3000, [&] {
        const sim::Measurement& seen = plant.measured();
        EXPECT_EQ(plant.step(-K * seen.position - C * seen.velocity), sim::Status::kOk);
        return a.dot(VectorXd(plant.position()));
      });
    });
    ++compared;
  }
  std::printf("%d of 16 loops\n", compared);
  EXPECT_GE(compared, 7);
}

/// The coarse steps in all directions but the first miss no lower limit.
TEST(Contact, DirectionFoundIsTheLowestOfThirteen) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    Random random(seed);
    const TouchedPanda panda(random, static_cast<int>(seed % 4), false);
    const controller::Audit audit(panda.model(), panda.stated);
    controller::ContactOptions options;
    options.damping = random.integer(0, 1) * random.log_uniform(1, 100);
    options.mass = random.integer(0, 1) * random.log_uniform(0.1, 3);
    const double found = find_contact(audit, panda.q, options).limit.stiffness;
    double least = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& n : controller::contact_directions()) {
      options.direction = n;
      least = std::min(least, find_contact(audit, panda.q, options).limit.stiffness);
    }
    if (std::isfinite(found + least)) {
      EXPECT_NEAR(found, least, 1e-5 * least);
    } else {
      EXPECT_EQ(found, least);
    }
  }
}

/// A Panda without gravity whose tip is pressed into a wall a hundredth of a millimetre deep by a
/// constant torque.
struct PressedArm {
  TouchedPanda panda;
  Eigen::Vector3d n;
  controller::ContactAt found;
  MatrixXd K, C;
  VectorXd a;
  static constexpr double kDepth = 1e-5;  // m

  explicit PressedArm(Random& random, int delay) : panda(random, delay, false) {
    const controller::Audit audit(panda.model(), panda.stated);
    controller::ContactOptions options;
    options.direction = n = random.vector(3).normalized();
    found = find_contact(audit, panda.q, options);
    const controller::LoopAt loop = audit.at(panda.q);
    K = loop.system.stiffness;
    C = loop.system.damping;
    a = evaluate(audit.model(), panda.q, JointVector::Zero(7)).J.topRows<3>().transpose() * n;
  }
  sim::ArmOptions world(double k) const {
    sim::ArmOptions world;
    world.coulomb_friction = false;
    world.wall =
        sim::Wall{sim::Arm(panda.robot()).tip_pose(panda.q).position + kDepth * n, n, {k, 0}};
    return world;
  }
  JointVector torque(double k, const JointVector& q, const JointVector& v) const {
    return -K * (q - panda.q) - C * v - k * kDepth * a;
  }
};

TEST(Contact, TheStandInTurnsWhereTheLimitIs) {
  for (std::uint64_t seed = 31; seed <= 33; ++seed) {
    Random random(seed);
    const PressedArm pressed(random, static_cast<int>(seed % 3));
    ASSERT_GT(pressed.found.limit.stiffness, 0);
    expect_turn(pressed.found.limit.stiffness, [&](double k) {
      sim::Arm arm(pressed.panda.robot(), pressed.world(k));
      analysis::SampledLoop loop = controller::timed(pressed.panda.stated, {});
      auto drives = testing::plant_options(loop);
      drives.integrator.max_step = 0.05 * loop.period;
      const JointVector hold = pressed.torque(k, pressed.panda.q, JointVector::Zero(7));
      drives.initial_torque = hold;
      const JointVector aside = 1e-9 * pressed.a.normalized();
      sim::Plant plant(arm, drives, pressed.panda.q + aside);
      return growth_rate(2000, [&] {
        const sim::Measurement& seen = plant.measured();
        EXPECT_EQ(plant.step(pressed.torque(k, seen.position, seen.velocity)), sim::Status::kOk);
        return pressed.a.dot(VectorXd(plant.position() - pressed.panda.q));
      });
    });
  }
}

/// A tendon ten metres long, which MuJoCo itself takes for a spring.
TEST(Contact, MujocoTurnsWhereTheLimitIs) {
  if (!testing::MujocoArm::available()) GTEST_SKIP() << "no MuJoCo (Debian: libmujoco-dev)";
  for (const int delay : {0, 1}) {
    Random random(40 + static_cast<std::uint64_t>(delay));
    PressedArm pressed(random, delay);
    pressed.panda.stated.cutoff = 0;
    pressed.panda.stated.difference_velocity = false;
    controller::ContactOptions options;
    options.direction = pressed.n;
    const controller::Audit audit(pressed.panda.model(), pressed.panda.stated);
    const double limit = find_contact(audit, pressed.panda.q, options).limit.stiffness;
    ASSERT_GT(limit, 0);
    expect_turn(limit, [&](double k) {
      sim::ArmOptions world;
      world.coulomb_friction = false;
      testing::MujocoOptions engine;
      engine.step = 2e-5;
      engine.delay = delay;
      engine.tendon = {k, pressed.n};
      const JointVector aside = 1e-6 * pressed.a.normalized(), q = pressed.panda.q;
      const auto arm = testing::MujocoArm::make(pressed.panda.robot(), world, engine, q);
      arm->place(q + aside, JointVector::Zero(7));
      return growth_rate(1500, [&] {
        arm->step(pressed.torque(0, arm->position(), arm->velocity()), 1e-3);
        return pressed.a.dot(VectorXd(arm->position() - q));
      });
    });
  }
}

}  // namespace
}  // namespace dashpot
