// Forces on an arm beside gravity and torque: friction, stops, a wall, pushes; and the audit.
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::sim {
namespace {

using Eigen::Vector3d;
using testing::fixed_steps;
using testing::joints;
using testing::kMethods;
using testing::precise;
using testing::run;
using testing::slider;

const Vector3d kWeightless = Vector3d::Zero(), kDown(0, 0, -9.81);
constexpr double kMass = 2;

// ------------------------------------------------------------------------------------- friction

TEST(Friction, ViscousDecaysExponentially) {
  Arm arm(slider(kWeightless, 3));
  Plant plant(arm, precise(0.01), joints({5}), joints({2}));
  ASSERT_EQ(run(plant, 100), Status::kOk);
  EXPECT_NEAR(plant.velocity()[0], 2 * std::exp(-3 / kMass), 1e-11);
  EXPECT_NEAR(plant.audit().viscous_heat, kMass / 2 * 4 * (1 - std::exp(-2 * 3 / kMass)), 1e-11);
  EXPECT_EQ(plant.audit().friction_heat, 0);
}

/// m v' = -f tanh(v / s) has sinh(v / s) = sinh(v0 / s) exp(-f t / (m s)).
TEST(Friction, CoulombSlowsEvenlyAndThenStops) {
  const double f = 4, v0 = 1;
  Arm arm(slider(kWeightless, 0, f));
  const double s = ArmOptions().friction_velocity;
  Plant plant(arm, precise(0.01), joints({5}), joints({v0}));
  for (int i = 1; i <= 100; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    // asinh(sinh(v0/s) e^-x) without overflow: v0/s is 100.
    const double x = v0 / s - std::log(2) - f * plant.time() / (kMass * s);
    const double expected = x > 20 ? s * (x + std::log(2)) : s * std::asinh(std::exp(x));
    EXPECT_NEAR(plant.velocity()[0], expected, 1e-9);
  }
  EXPECT_LT(plant.velocity()[0], 1e-20);
  EXPECT_NEAR(plant.audit().friction_heat, kMass / 2 * v0 * v0, 1e-9);
}

TEST(Friction, CanBeSwitchedOff) {
  ArmOptions options;
  options.viscous_friction = false;
  options.coulomb_friction = false;
  Arm arm(slider(kWeightless, 3, 4), options);
  Plant plant(arm, precise(0.01), joints({5}), joints({1}));
  ASSERT_EQ(run(plant, 100), Status::kOk);
  EXPECT_NEAR(plant.velocity()[0], 1, 1e-14);
}

// -------------------------------------------------------------------------------------- contacts

/// A mass that falls on a spring and damper and leaves when they no longer push.
class Bounce {
 public:
  Bounce(double height, const Contact& contact)
      : k_(contact.stiffness), c_(contact.damping), height_(height) {
    fall_ = std::sqrt(2 * height / kG);
    rest_ = kMass * kG / k_;
    a_ = c_ / (2 * kMass);
    w_ = std::sqrt(k_ / kMass - a_ * a_);
    B_ = (kG * fall_ - a_ * rest_) / w_;
    double low = 0;
    while (force(low + 1e-5) > 0) low += 1e-5;
    double high = low + 1e-5;
    for (int i = 0; i < 60; ++i) (force((low + high) / 2) > 0 ? low : high) = (low + high) / 2;
    contact_ = low;
  }

  /// Height until the second fall, m.
  double height(double t) const {
    if (t < fall_) return height_ - kG / 2 * t * t;
    t -= fall_;
    if (t < contact_) return -depth(t);
    const double after = t - contact_;
    return -depth(contact_) - rate(contact_) * after - kG / 2 * after * after;
  }
  double leaves_at() const { return fall_ + contact_; }
  /// Returns the heat of the damper and of the spring that remains pressed, J.
  double heat() const {
    const double v = rate(contact_), d = depth(contact_);
    return kMass * kG * (height_ + d) - kMass / 2 * v * v;
  }

 private:
  static constexpr double kG = 9.81;
  double depth(double t) const {
    return rest_ + std::exp(-a_ * t) * (-rest_ * std::cos(w_ * t) + B_ * std::sin(w_ * t));
  }
  double rate(double t) const {
    return std::exp(-a_ * t) *
           ((a_ * rest_ + w_ * B_) * std::cos(w_ * t) + (w_ * rest_ - a_ * B_) * std::sin(w_ * t));
  }
  double force(double t) const { return k_ * depth(t) + c_ * rate(t); }

  double k_, c_, height_, fall_, rest_, a_, w_, B_, contact_;
};

class Contacts : public ::testing::TestWithParam<bool> {
 protected:
  const Contact contact{20000, 60};
  const double height = 0.05;

  ArmOptions options() const {
    ArmOptions options;
    if (GetParam()) {
      options.wall = Wall{Vector3d(3, -2, 0), Vector3d(0, 0, 5), contact};
    } else {
      options.stops = contact;  // the slider's lower limit is 0
    }
    return options;
  }
};
INSTANTIATE_TEST_SUITE_P(Kinds, Contacts, ::testing::Bool(), [](const auto& instance) {
  return std::string(instance.param ? "Wall" : "Stop");
});

TEST_P(Contacts, BounceAsTheClosedFormSays) {
  const Bounce expected(height, contact);
  Arm arm(slider(kDown), options());
  Plant plant(arm, precise(0.001), joints({height}));
  for (int i = 0; i < 170; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    EXPECT_NEAR(plant.position()[0], expected.height(plant.time()), 1e-9) << plant.time();
    EXPECT_NEAR(plant.audit().imbalance(), 0, 1e-9) << plant.time();
  }
  ASSERT_GT(plant.time(), expected.leaves_at() + 0.01);
  EXPECT_GT(plant.velocity()[0], 0.1);
  EXPECT_NEAR(plant.audit().contact_heat,
              expected.heat() - contact_energy(contact, -plant.position()[0]), 1e-8);
}

TEST_P(Contacts, AreMetWithinAStepByFixedSteps) {
  const Bounce expected(height, contact);
  for (const Method method : kMethods) {
    Arm arm(slider(kDown), options());
    Plant plant(arm, fixed_steps(method, 1e-5), joints({height}));
    ASSERT_EQ(run(plant, 17000), Status::kOk);
    EXPECT_NEAR(plant.position()[0], expected.height(plant.time()), 2e-5) << name_of(method);
    EXPECT_NEAR(plant.audit().imbalance(), 0, 2e-3) << name_of(method);
  }
}

TEST_P(Contacts, AreLandedOnByAdaptiveSteps) {
  const Bounce expected(height, contact);
  Arm arm(slider(kDown), options());
  PlantOptions steps = precise(0.17);
  steps.integrator.absolute_tolerance = 1e-8;
  Plant plant(arm, steps, joints({height}));
  ASSERT_EQ(run(plant, 1), Status::kOk);
  EXPECT_NEAR(plant.position()[0], expected.height(plant.time()), 1e-9);
}

TEST(Wall, HasNoFrictionAndPushesAlongItsNormalOnly) {
  ArmOptions options;
  options.wall = Wall{Vector3d::Zero(), Vector3d(1, 0, 1), Contact{1e4, 0}};
  Arm arm(slider(kWeightless), options);
  // At depth d the slider feels the normal's z part of the force k d: k d / sqrt(2), d = -z /
  // sqrt(2).
  Plant plant(arm, precise(1e-5), joints({-0.01}));
  ASSERT_EQ(run(plant, 1), Status::kOk);
  EXPECT_NEAR(plant.velocity()[0], 1e4 * 0.01 / 2 / kMass * 1e-5, 1e-10);
  EXPECT_NEAR(plant.audit().initial.springs, 0.5 * 1e4 * 0.01 * 0.01 / 2, 1e-14);
}

TEST(Stops, StandAtBothLimits) {
  ArmOptions options;
  options.stops = Contact{1e4, 0};
  Arm arm(slider(kWeightless), options);
  Plant plant(arm, precise(0.01), joints({9.9}), joints({1}));
  ASSERT_EQ(run(plant, 2000), Status::kOk);  // twice there and back
  EXPECT_NEAR(std::abs(plant.velocity()[0]), 1, 1e-9);
  EXPECT_GT(plant.position()[0], 0);
  EXPECT_LT(plant.position()[0], 10);
}

// ---------------------------------------------------------------------------------------- pushes

TEST(Wrenches, ChangeTheMomentumByTheirImpulse) {
  ArmOptions options;  // edges off the grid of ticks, overlapping
  options.wrenches = {{0.0123, 0.0456, (Vector6() << 7, 0, 30, 1, 1, 1).finished()},
                      {0.0301, 0.0787, (Vector6() << 0, 9, -4, 0, 5, 0).finished()}};
  const double impulse = 30 * (0.0456 - 0.0123) - 4 * (0.0787 - 0.0301);
  for (const Method method : kMethods) {
    Arm arm(slider(kWeightless), options);
    Plant plant(arm, fixed_steps(method, 0.01), joints({5}));
    ASSERT_EQ(run(plant, 10), Status::kOk);
    EXPECT_NEAR(plant.velocity()[0], impulse / kMass, 1e-11) << name_of(method);
    const EnergyAudit audit = plant.audit();
    if (method == Method::kSemiImplicitEuler) continue;  // its audit is of order 1
    EXPECT_NEAR(audit.by_world, 0.5 * impulse * impulse / kMass, 1e-10);
  }
}

// ---------------------------------------------------------------------------------- energy audit

class Audit : public ::testing::TestWithParam<testing::ChainFile> {};
INSTANTIATE_TEST_SUITE_P(Arms, Audit, ::testing::ValuesIn(testing::arm_files()),
                         [](const auto& instance) { return instance.param.name; });

/// An arm that swings through every force of a scene.
struct Scene {
  RobotParameters parameters;
  ArmOptions options;
  JointVector q, qd;

  Scene(const testing::ChainFile& file, testing::Random& random) {
    const Robot robot = testing::robot_of(file);
    const int n = robot.dof();
    parameters.reflected_inertia = JointVector::Constant(n, 0.1);
    parameters.viscous_friction = random.vector(n).cwiseAbs();
    parameters.coulomb_friction = random.vector(n).cwiseAbs();
    options.friction_velocity = 0.05;
    options.stops = Contact{2000, 20};
    q = JointVector(n);
    qd = random.vector(n);
    for (int i = 0; i < n; ++i) {
      const Joint& joint = robot.joints()[static_cast<std::size_t>(i)];
      q[i] = random.uniform(std::max(joint.lower, -1.5), std::min(joint.upper, 1.5));
    }
    Arm arm(robot);
    const Vector3d tip = arm.tip_pose(q).position;
    options.wall = Wall{tip - Vector3d(0, 0, 0.05), Vector3d(0.2, 0.1, 1), Contact{5000, 30}};
  }
};

TEST_P(Audit, NeverShowsEnergyFromNowhere) {
  testing::Random random(721);
  for (int trial = 0; trial < 4; ++trial) {
    Scene scene(GetParam(), random);
    if (trial == 3) {
      scene.parameters.gear_stiffness = JointVector::Constant(scene.q.size(), 3000);
      scene.parameters.gear_damping = JointVector::Constant(scene.q.size(), 3);
    }
    Arm arm(testing::robot_of(GetParam(), scene.parameters), scene.options);
    PlantOptions options = precise(0.01);
    options.integrator.absolute_tolerance = options.integrator.relative_tolerance = 1e-11;
    Plant plant(arm, options, scene.q, scene.qd);
    EnergyAudit last = plant.audit();
    for (int i = 0; i < 100; ++i) {
      ASSERT_EQ(run(plant, 1), Status::kOk);
      const EnergyAudit audit = plant.audit();
      EXPECT_NEAR(audit.imbalance(), 0, 1e-7);
      EXPECT_LT(audit.stored.sum(), last.stored.sum() + 1e-8);  // nothing drives it
      EXPECT_GE(audit.viscous_heat, last.viscous_heat);
      EXPECT_GE(audit.friction_heat, last.friction_heat);
      EXPECT_GE(audit.contact_heat, last.contact_heat - 1e-12);
      EXPECT_GE(audit.gear_heat, last.gear_heat);
      last = audit;
    }
    EXPECT_EQ(last.gear_heat > 0.01, trial == 3) << last.gear_heat;
    EXPECT_GT(last.viscous_heat, 0.01);
    EXPECT_GT(last.friction_heat, 0.01);
    EXPECT_GT(last.contact_heat, 0.01);
    EXPECT_EQ(last.work_in(), 0);
  }
}

TEST_P(Audit, ClosesUnderTorquesAndPushes) {
  testing::Random random(722);
  Scene scene(GetParam(), random);
  scene.options.wrenches = {{0.105, 0.2, 20 * random.vector(6)}, {0.15, 0.5, 5 * random.vector(6)}};
  scene.options.tables = {{0.1003, 0.2, {2e4, 0}}, {0.2, 0.3, {500, 30}}};
  for (const Method method : kMethods) {
    Arm arm(testing::robot_of(GetParam(), scene.parameters), scene.options);
    Plant plant(arm, fixed_steps(method, 2e-4), scene.q, scene.qd);
    testing::Random torques(723);
    JointVector torque = JointVector::Zero(arm.dof());
    for (int i = 0; i < 2500; ++i) {
      if (i % 5 == 0) torque = 10 * torques.vector(arm.dof());
      ASSERT_EQ(plant.step(torque), Status::kOk) << name_of(method);
    }
    const EnergyAudit audit = plant.audit();
    EXPECT_GT(std::abs(audit.by_actuators), 0.01);
    EXPECT_GT(std::abs(audit.by_world), 0.1);
    const double tolerance = method == Method::kSemiImplicitEuler ? 0.02 : 1e-3;
    EXPECT_NEAR(audit.imbalance(), 0,
                tolerance * (audit.initial.kinetic + audit.dissipated() + audit.work_in()))
        << name_of(method);
  }
}

TEST(ArmOptions, ThatMakeNoSenseAreRefused) {
  using Options = ArmOptions;
  const auto wall = [](Options& o) { o.wall = Wall{Vector3d::Zero(), Vector3d::UnitZ(), {}}; };
  const auto load = [](Options& o, double mass, const Vector3d& center, const Vector3d& moments) {
    o.loads = {{1, 2, {mass, center, moments.asDiagonal()}}};
  };
  const Vector3d zero = Vector3d::Zero(), one = Vector3d::Ones();
  const double nan = std::nan("");
  const std::vector<std::pair<std::string, std::function<void(Options&)>>> cases = {
      {"accepted", [](Options&) {}},
      {"friction_velocity: must be positive, rad/s", [](Options& o) { o.friction_velocity = 0; }},
      {"stops: stiffness: is -1.000000 N m/rad, must be finite and not negative",
       [](Options& o) {
         o.stops = Contact{-1, 0};
       }},
      {"stops: damping: is -1.000000 N m s/rad, must be finite and not negative",
       [](Options& o) {
         o.stops = Contact{0, -1};
       }},
      {"wall: stiffness: is -1.000000 N/m, must be finite and not negative",
       [&](Options& o) {
         wall(o), o.wall->contact = {-1, 0};
       }},
      {"wall: damping: is -1.000000 N s/m, must be finite and not negative",
       [&](Options& o) {
         wall(o), o.wall->contact = {0, -1};
       }},
      {"wall: point: is not finite", [&](Options& o) { wall(o), o.wall->point.x() = 1 / 0.0; }},
      {"wall: normal: is zero or not finite", [&](Options& o) { wall(o), o.wall->normal = zero; }},
      {"tables: need a wall",
       [](Options& o) {
         o.tables = {{0, 1, {1e4, 0}}};
       }},
      {"tables: damping: is -1.000000 N s/m, must be finite and not negative",
       [&](Options& o) {
         wall(o), o.tables = {{0, 1, {1e4, -1}}};
       }},
      {"tables: a piece does not begin before it ends",
       [&](Options& o) {
         wall(o), o.tables = {{1, 1, {1e4, 0}}};
       }},
      {"wrenches: a piece does not begin before it ends",
       [](Options& o) {
         o.wrenches = {{2, 1, Vector6::Ones()}};
       }},
      {"wrenches: a piece is not finite",
       [&](Options& o) {
         o.wrenches = {{1, 2, Vector6::Constant(nan)}};
       }},
      {"accepted", [&](Options& o) { load(o, 1, zero, one); }},
      {"loads: mass: is -1.000000 kg, must be finite and not negative",
       [&](Options& o) { load(o, -1, zero, one); }},
      {"loads: a body is not finite", [&](Options& o) { load(o, 1, nan * one, one); }},
      {"loads: an inertia is not symmetric positive semidefinite",
       [&](Options& o) {
         load(o, 1, zero, {1, 1, -1});
       }},
      {"loads: an inertia is not symmetric positive semidefinite",
       [&](Options& o) { load(o, 1, zero, one), o.loads[0].value.about_center(0, 1) = 0.1; }},
      {"loads: a piece does not begin before it ends",
       [&](Options& o) { load(o, 1, zero, one), o.loads[0].end = 1; }},
  };
  for (const auto& [said, change] : cases) {
    ArmOptions options;
    change(options);
    EXPECT_EQ(testing::refusal_of([&] { Arm(slider(kDown), options); }), said);
  }
}

}  // namespace
}  // namespace dashpot::sim
