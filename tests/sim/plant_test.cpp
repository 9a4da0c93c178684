// The loop as on hardware: the parts between command, motion and measurement.
#include <dashpot/tests/sim/chains.hpp>
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::sim {
namespace {

using Eigen::MatrixXd;
using testing::joints;
using testing::kOne;
using testing::kZero;
using testing::LinearSystem;
using testing::run;

TEST(Plant, HoldsATorqueForAPeriod) {
  LinearSystem mass(2 * kOne, kZero, kZero);
  PlantOptions options;
  options.period = 0.002;
  Plant plant(mass, options, joints({1}), joints({3}));
  EXPECT_EQ(plant.measured().time, 0);
  ASSERT_EQ(plant.step(joints({5})), Status::kOk);
  EXPECT_NEAR(plant.position()[0], 1 + 3 * 0.002 + 5.0 / 2 * 0.002 * 0.002 / 2, 1e-15);
  EXPECT_NEAR(plant.velocity()[0], 3 + 5.0 / 2 * 0.002, 1e-15);
  EXPECT_EQ(plant.measured().time, 2000000);
  EXPECT_EQ(plant.measured().position, plant.position());
  EXPECT_EQ(plant.measured().velocity, plant.velocity());
  EXPECT_EQ(plant.measured().torque, joints({5}));
}

TEST(Plant, KeepsTimeWithoutDrift) {
  LinearSystem mass(kOne, kZero, kZero);
  Plant plant(mass, {}, joints({0}));
  ASSERT_EQ(run(plant, 123456), Status::kOk);
  EXPECT_EQ(plant.measured().time, 123456000000);
}

TEST(Torque, ArrivesAfterTheDelayToTheTick) {
  for (const int delay : {0, 1, 2, 7}) {
    LinearSystem mass(kOne, kZero, kZero);
    PlantOptions options;
    options.delay = delay;
    options.initial_torque = joints({-4});
    Plant plant(mass, options, joints({0}));
    double speed = 0;
    for (int i = 0; i < 30; ++i) {
      ASSERT_EQ(plant.step(joints({1.0 * i * i})), Status::kOk);
      const double expected = i < delay ? -4 : (i - delay) * (i - delay);
      EXPECT_EQ(plant.torque()[0], expected) << "delay " << delay << ", tick " << i;
      speed += 0.001 * expected;
      EXPECT_NEAR(plant.velocity()[0], speed, 1e-13);
    }
  }
}

TEST(Torque, IsDelayedAndThenFilteredLikeAHeldInputByAFirstOrderLag) {
  for (const int delay : {0, 3}) {
    LinearSystem mass(kOne, kZero, kZero);
    PlantOptions options;
    options.torque_cutoff = 30;
    options.delay = delay;
    options.initial_torque = joints({2});
    Plant plant(mass, options, joints({0}));
    for (int i = 1; i <= 100; ++i) {
      ASSERT_EQ(plant.step(joints({10})), Status::kOk);
      const double since = std::max(0, i - delay) * 0.001;
      EXPECT_NEAR(plant.torque()[0], 10 - 8 * std::exp(-2 * std::numbers::pi * 30 * since), 1e-13);
    }
  }
}

TEST(Torque, IsLimited) {
  LinearSystem masses(MatrixXd::Identity(3, 3), MatrixXd::Zero(3, 3), MatrixXd::Zero(3, 3));
  PlantOptions options;
  options.torque_limit = joints({5, std::numeric_limits<double>::infinity(), 0});
  Plant plant(masses, options, joints({0, 0, 0}));
  ASSERT_EQ(plant.step(joints({-7, 1e6, 1})), Status::kOk);
  EXPECT_EQ(plant.torque(), joints({-5, 1e6, 0}));
  ASSERT_EQ(plant.step(joints({4, -1e6, -1})), Status::kOk);
  EXPECT_EQ(plant.torque(), joints({4, -1e6, 0}));
}

// --------------------------------------------------------------------------------------- sensors

TEST(Sensors, ShowMultiplesOfTheResolutionNearTheTruth) {
  const double count = 2 * std::numbers::pi / 4096;
  LinearSystem masses(MatrixXd::Identity(2, 2), MatrixXd::Zero(2, 2), MatrixXd::Zero(2, 2));
  PlantOptions options;
  options.position_resolution = joints({count, 0});
  Plant plant(masses, options, joints({-1, 1}), joints({0.7, 0.7}));
  double largest = 0;
  for (int i = 0; i < 3000; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    const double shown = plant.measured().position[0], error = shown - plant.position()[0];
    EXPECT_LE(std::abs(error), count / 2 * (1 + 1e-12));
    EXPECT_NEAR(std::remainder(shown, count), 0, 1e-15);
    EXPECT_EQ(plant.measured().position[1], plant.position()[1]);
    largest = std::max(largest, std::abs(error));
  }
  EXPECT_GT(largest, 0.45 * count);
}

TEST(Sensors, DifferenceWhatTheyShow) {
  LinearSystem mass(kOne, kZero, 40 * kOne);
  PlantOptions options;
  options.position_resolution = joints({1e-4});
  options.position_noise = joints({3e-4});
  options.difference_velocity = true;
  Plant plant(mass, options, joints({1}), joints({0.5}));
  double last = plant.measured().position[0];
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    const double shown = plant.measured().position[0];
    EXPECT_EQ(plant.measured().velocity[0], (shown - last) / 0.001);
    last = shown;
  }
}

/// Mean, variance and correlations of N samples have standard errors of about 1 / sqrt(N).
TEST(Sensors, HaveWhiteNormalNoiseOfTheGivenSize) {
  LinearSystem masses(MatrixXd::Identity(2, 2), MatrixXd::Zero(2, 2), MatrixXd::Zero(2, 2));
  PlantOptions options;
  options.position_noise = joints({1e-3, 0});
  options.velocity_noise = joints({0, 2e-2});
  options.seed = 42;
  Plant plant(masses, options, joints({0.5, -0.5}));
  const int count = 40000;
  double sum = 0, square = 0, fourth = 0, lag = 0, cross = 0, last = 0, v_square = 0;
  for (int i = 0; i < count; ++i) {
    ASSERT_EQ(run(plant, 1), Status::kOk);
    const double x = (plant.measured().position[0] - 0.5) / 1e-3;
    const double v = plant.measured().velocity[1] / 2e-2;
    EXPECT_EQ(plant.measured().position[1], -0.5);
    EXPECT_EQ(plant.measured().velocity[0], 0);
    sum += x;
    square += x * x;
    fourth += x * x * x * x;
    lag += x * last;
    cross += x * v;
    v_square += v * v;
    last = x;
  }
  const double error = 5 / std::sqrt(count);
  EXPECT_NEAR(sum / count, 0, error);
  EXPECT_NEAR(square / count, 1, error * std::sqrt(2));
  EXPECT_NEAR(fourth / count, 3, error * std::sqrt(96));
  EXPECT_NEAR(lag / count, 0, error);
  EXPECT_NEAR(cross / count, 0, error);
  EXPECT_NEAR(v_square / count, 1, error * std::sqrt(2));
}

// ------------------------------------------------------------------------------------- same bits

/// Everything that a plant can have.
PlantOptions everything(std::uint64_t seed) {
  PlantOptions options;
  options.torque_limit = JointVector::Constant(7, 20);
  options.delay = 2;
  options.torque_cutoff = 100;
  options.position_noise = JointVector::Constant(7, 1e-5);
  options.position_resolution = JointVector::Constant(7, 1e-5);
  options.difference_velocity = true;
  options.seed = seed;
  return options;
}

std::vector<double> closed_loop(PlantOptions options, const IntegratorOptions& integrator) {
  options.integrator = integrator;
  ArmOptions arm_options;
  arm_options.stops = Contact{1000, 5};
  arm_options.wrenches = {{0.01, 0.03, Vector6::Ones()}};
  Arm arm(testing::robot_of(testing::panda_file()), arm_options);
  const JointVector home = joints({0, -0.7, 0.2, -2.3, 0, 1.5, 0.7});
  Plant plant(arm, options, home);
  std::vector<double> trace;
  for (int i = 0; i < 100; ++i) {
    const Measurement& shown = plant.measured();
    EXPECT_EQ(plant.step(100 * (home - shown.position) - 2 * shown.velocity), Status::kOk);
    const JointVector q = plant.position();
    trace.insert(trace.end(), q.begin(), q.end());
    trace.insert(trace.end(), shown.velocity.begin(), shown.velocity.end());
    trace.push_back(plant.audit().imbalance());
  }
  return trace;
}

TEST(Plant, GivesTheSameBitsTwice) {
  for (const Method method : testing::kMethods) {
    IntegratorOptions integrator;
    integrator.method = method;
    EXPECT_EQ(closed_loop(everything(3), integrator), closed_loop(everything(3), integrator));
    integrator.adaptive = estimates_error(method);
    EXPECT_EQ(closed_loop(everything(3), integrator), closed_loop(everything(3), integrator));
  }
  EXPECT_NE(closed_loop(everything(3), {}), closed_loop(everything(4), {}));
}

/// What a simulation leaves out because the scene has none of it, beside a scene that has it
/// without effect. 1e-11 is rounding of a hundred periods; Rosenbrock's method differentiates
/// numerically.
TEST(Plant, LeavesOutNothingThatMatters) {
  struct Scene {
    RobotParameters parameters;
    ArmOptions arm;
    PlantOptions plant;
  };
  struct Part {
    const char* what;
    double allowed;
    void (*add)(Scene&);
  };
  const Part parts[] = {
      {"viscous", 1e-11, [](Scene& s) { s.parameters.viscous_friction.setConstant(7, 1e-18); }},
      {"Coulomb", 1e-11, [](Scene& s) { s.parameters.coulomb_friction.setConstant(7, 1e-18); }},
      {"stops", 0,
       [](Scene& s) {
         s.arm.stops = Contact{2000, 20};
       }},
      {"wall", 0, [](Scene& s) { s.arm.wall.emplace().point.z() = -10; }},
      {"wrench", 1e-11,
       [](Scene& s) {
         s.arm.wrenches = {{0, 1e9, 1e-18 * Vector6::Ones()}};
       }},
      {"limit", 0,
       [](Scene& s) {
         s.plant.torque_limit.setConstant(7, std::numeric_limits<double>::infinity());
       }},
      {"low-pass", 1e-11, [](Scene& s) { s.plant.torque_cutoff = 1e9; }},
      {"noise", 1e-15, [](Scene& s) { s.plant.position_noise.setConstant(7, 1e-18); }},
      {"noise of rates", 1e-15, [](Scene& s) { s.plant.velocity_noise.setConstant(7, 1e-18); }},
      {"counts", 1e-15, [](Scene& s) { s.plant.position_resolution.setConstant(7, 0x1p-52); }}};
  const JointVector q{{0.2, -0.6, -0.1, -2.2, 0.3, 1.4, 0.6}};
  for (const Method method : testing::kMethods) {
    Scene lean;
    lean.parameters.viscous_friction = lean.parameters.coulomb_friction = JointVector::Zero(7);
    lean.plant.integrator.method = method;
    const auto moved = [&q](const Scene& scene) {
      Arm arm(testing::robot_of(testing::panda_file(), scene.parameters), scene.arm);
      Plant plant(arm, scene.plant, q);
      Eigen::VectorXd seen(14);
      for (int k = 0; k < 100; ++k) {  // within the joints' limits
        const JointVector phase = JointVector::LinSpaced(7, 0.01 * k, 0.01 * k + 6);
        const JointVector size{{10, 10, 10, 10, 0.1, 0.1, 0.1}};
        EXPECT_EQ(plant.step(size.cwiseProduct(JointVector(phase.array().sin()))), Status::kOk);
      }
      seen << plant.measured().position, plant.measured().velocity;
      return seen;
    };
    const Eigen::VectorXd without = moved(lean);
    for (const Part& part : parts) {
      Scene full = lean;
      part.add(full);
      const double allowed =
          method == Method::kRosenbrock && part.allowed == 1e-11 ? 1e-8 : part.allowed;
      EXPECT_LE((moved(full) - without).cwiseAbs().maxCoeff(), allowed)
          << part.what << ", " << name_of(method);
    }
  }
}

// --------------------------------------------------------------------------------------- failures

TEST(Plant, RefusesBadCommandsAndStaysWhereItIs) {
  Arm arm(testing::robot_of(testing::panda_file()));
  PlantOptions options = everything(5);
  const JointVector home = joints({0, -0.7, 0.2, -2.3, 0, 1.5, 0.7});
  Plant plant(arm, options, home), twin(arm, options, home);
  JointVector torque = JointVector::Constant(7, 3);
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(plant.step(JointVector::Zero(6)), Status::kCommandWrongSize);
    torque[3] = std::nan("");
    EXPECT_EQ(plant.step(torque), Status::kCommandNotFinite);
    torque[3] = i;
    EXPECT_EQ(plant.step(torque), Status::kOk);
    EXPECT_EQ(twin.step(torque), Status::kOk);
    EXPECT_EQ(plant.position(), twin.position());
    EXPECT_EQ(plant.measured().position, twin.measured().position);
  }
}

TEST(Plant, TakesAFailedStepBack) {
  LinearSystem stiff(kOne, kZero, 1e8 * kOne);  // 10000 rad/s
  PlantOptions options;
  options.delay = 2;
  options.torque_cutoff = 50;
  Plant plant(stiff, options, joints({1}));
  Status status = Status::kOk;
  for (int i = 0; i < 10000 && status == Status::kOk; ++i) status = plant.step(joints({1.0 * i}));
  ASSERT_EQ(status, Status::kStateNotFinite);
  const JointVector q = plant.position(), torque = plant.torque();
  const std::int64_t ticks = plant.ticks();
  EXPECT_TRUE(q.allFinite());
  EXPECT_EQ(plant.step(joints({7})), Status::kStateNotFinite);
  EXPECT_EQ(plant.position(), q);
  EXPECT_EQ(plant.torque(), torque);
  EXPECT_EQ(plant.ticks(), ticks);
  EXPECT_STREQ(to_text(status), "the motion is not finite");
}

TEST(Plant, RefusesOptionsThatMakeNoSense) {
  using Options = PlantOptions;
  const std::vector<std::pair<std::string, std::function<void(Options&)>>> cases = {
      {"accepted", [](Options&) {}},
      {"period: must be positive, s", [](Options& o) { o.period = 0; }},
      {"delay: must not be negative, ticks", [](Options& o) { o.delay = -1; }},
      {"torque_cutoff: must be finite and not negative, Hz",
       [](Options& o) { o.torque_cutoff = -1; }},
      {"torque_limit: must not be negative, N m",
       [](Options& o) { o.torque_limit = joints({-1}); }},
      {"position_noise: has 2 entries, must have 1",
       [](Options& o) {
         o.position_noise = joints({1, 1});
       }},
  };
  LinearSystem mass(kOne, kZero, kZero);
  for (const auto& [said, change] : cases) {
    Options options;
    change(options);
    EXPECT_EQ(testing::refusal_of([&] { Plant(mass, options, joints({0})); }), said);
  }
  EXPECT_EQ(testing::refusal_of([&] {
              Plant(mass, {}, joints({0, 0}));
            }),
            "initial position: has 2 entries, must have 1");
}

}  // namespace
}  // namespace dashpot::sim
