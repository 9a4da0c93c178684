// Integrators against theory.
#include <dashpot/tests/sim/scenes.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <complex>

namespace dashpot::sim {
namespace {

using Complex = std::complex<double>;
using Eigen::VectorXd;
using testing::fixed_steps;
using testing::joints;
using testing::kMethods;
using testing::kOne;
using testing::kZero;
using testing::LinearSystem;
using testing::run;

int order_of(Method method) {
  switch (method) {
    case Method::kSemiImplicitEuler:
      return 1;
    case Method::kImplicitMidpoint:
      return 2;
    case Method::kRosenbrock:
      return 3;
    case Method::kRungeKutta4:
      return 4;
    case Method::kDormandPrince8:
      return 8;
  }
  return 0;
}

class Methods : public ::testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(All, Methods, ::testing::ValuesIn(kMethods),
                         [](const auto& instance) { return name_of(instance.param); });

VectorXd state_of(const Plant& plant) {
  VectorXd state(2 * plant.position().size());
  state << plant.position(), plant.velocity();
  return state;
}

/// The slope of log error over log step must be the order.
void expect_order(double coarse_error, double fine_error, Method method) {
  EXPECT_GT(fine_error, 1e-13) << "only rounding is left";
  EXPECT_NEAR(std::log2(coarse_error / fine_error), order_of(method), 0.35);
}

TEST_P(Methods, HaveTheirOrderOnAnArm) {
  const auto end_of = [](const PlantOptions& options, int ticks) {
    Arm arm(testing::pendulum(2));
    Plant plant(arm, options, joints({1.2, -1}), joints({1, 2}));
    EXPECT_EQ(run(plant, ticks), Status::kOk);
    return state_of(plant);
  };
  const VectorXd expected = end_of(testing::precise(0.1), 5);
  const auto error = [&](int steps) {
    return (end_of(fixed_steps(GetParam(), 0.5 / steps), steps) - expected).norm();
  };
  const int steps = order_of(GetParam()) < 3 ? 800 : order_of(GetParam()) < 8 ? 80 : 6;
  expect_order(error(steps), error(2 * steps), GetParam());
}

TEST_P(Methods, CloseTheEnergyAuditWithTheirOrder) {
  ArmOptions options;
  options.wrenches = {{0.013, 0.087, (Vector6() << 3, 1, -2, 0.1, 0.2, 0.3).finished()}};
  RobotParameters parameters;
  const auto imbalance = [&](int steps) {
    Arm arm(testing::pendulum(2), options);
    Plant plant(arm, fixed_steps(GetParam(), 0.4 / steps), joints({1.2, -1}), joints({1, 2}));
    for (int i = 0; i < steps; ++i) EXPECT_EQ(plant.step(joints({2, -1})), Status::kOk);
    return std::abs(plant.audit().imbalance());
  };
  const int steps = order_of(GetParam()) < 3 ? 800 : order_of(GetParam()) < 8 ? 40 : 4;
  const double coarse = imbalance(steps), fine = imbalance(2 * steps);
  // Some gain an order over the guarantee: an implicit midpoint does on the sum.
  EXPECT_GT(std::log2(coarse / fine), order_of(GetParam()) - 0.3);
  EXPECT_LT(coarse, order_of(GetParam()) == 1 ? 0.1 : 1e-4);
}

// ------------------------------------------------- the oscillator q'' = -q: y+ = R(i h) y

/// (q, qd) after one step from (1, 0).
VectorXd oscillator_step(Method method, double h) {
  LinearSystem system(kOne, kZero, kOne);
  Plant plant(system, fixed_steps(method, h), joints({1}));
  EXPECT_EQ(run(plant, 1), Status::kOk);
  return state_of(plant);
}

TEST(Oscillator, StepsHaveTheStabilityFunctionOfTheMethod) {
  for (const double h : {0.01, 0.3, 1.0, 2.5}) {
    const Complex z(0, h);
    const Complex taylor = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)));
    const std::pair<Method, Complex> functions[] = {
        {Method::kRungeKutta4, taylor},
        {Method::kImplicitMidpoint, (1.0 + z / 2.0) / (1.0 - z / 2.0)},
        // (1 - z/2)^4 R is a cubic that agrees with (1 - z/2)^4 e^z to order 3.
        {Method::kRosenbrock, (1.0 - z + std::pow(z, 3) / 6.0) / std::pow(1.0 - z / 2.0, 4)}};
    for (const auto& [method, R] : functions) {
      // (q, qd) = (Re, -Im) of R. Rosenbrock's Jacobian is good to 8 digits.
      const double tolerance = method == Method::kRosenbrock ? 1e-7 : 1e-13;
      const VectorXd state = oscillator_step(method, h);
      EXPECT_NEAR(state[0], R.real(), tolerance) << name_of(method) << ", h = " << h;
      EXPECT_NEAR(state[1], -R.imag(), tolerance) << name_of(method) << ", h = " << h;
    }
    const VectorXd euler = oscillator_step(Method::kSemiImplicitEuler, h);
    EXPECT_NEAR(euler[1], -h, 1e-15);
    EXPECT_NEAR(euler[0], 1 - h * h, 1e-15);
  }
}

// ------------------------------------------------- a stiff joint: 1e5 N m/rad on 0.1 kg m^2

/// 1000 rad/s, lightly damped, pushed by a constant torque of 100 N m.
Status run_stiff(Method method, double h, int ticks, double damping, double& q) {
  LinearSystem system(0.1 * kOne, damping * kOne, 1e5 * kOne);
  Plant plant(system, fixed_steps(method, h), joints({0}));
  Status status = Status::kOk;
  for (int i = 0; i < ticks && status == Status::kOk; ++i) status = plant.step(joints({100}));
  q = plant.position()[0];
  return status;
}

TEST(StiffJoint, NeedsShortStepsOfExplicitMethodsOnly) {
  double q = 0;
  for (const Method method : {Method::kRungeKutta4, Method::kSemiImplicitEuler}) {
    EXPECT_EQ(run_stiff(method, 0.001, 5000, 20, q), Status::kOk);
    EXPECT_NEAR(q, 1e-3, 1e-9) << name_of(method);
    EXPECT_EQ(run_stiff(method, 0.003, 5000, 20, q), Status::kStateNotFinite) << name_of(method);
    EXPECT_TRUE(std::isfinite(q));
  }
  for (const double h : {0.001, 0.003, 0.1}) {
    EXPECT_EQ(run_stiff(Method::kImplicitMidpoint, h, 5000, 20, q), Status::kOk);
    EXPECT_NEAR(q, 1e-3, 1e-9) << h;
    EXPECT_EQ(run_stiff(Method::kRosenbrock, h, 5000, 20, q), Status::kOk);
    EXPECT_NEAR(q, 1e-3, 1e-9) << h;
  }
}

TEST(StiffJoint, IsDampedWithinAStepByRosenbrockAndNotByMidpoint) {
  const double h = 1;  // 1000 rad in a step: L-stable against A-stable
  double q = 0;
  EXPECT_EQ(run_stiff(Method::kRosenbrock, h, 3, 0, q), Status::kOk);
  EXPECT_NEAR(q, 1e-3, 1e-6);
  EXPECT_EQ(run_stiff(Method::kImplicitMidpoint, h, 3, 0, q), Status::kOk);
  EXPECT_NEAR(q, 2e-3, 1e-6);
}

// --------------------------------------------------------------------------- step size control

TEST(AdaptiveSteps, KeepToTheToleranceAndGrowWithIt) {
  for (const Method method : {Method::kDormandPrince8, Method::kRosenbrock}) {
    double last_error = 0;
    for (const double tolerance : {1e-9, 1e-6}) {
      Arm arm(testing::pendulum(2));
      PlantOptions options = fixed_steps(method, 0.5);
      options.integrator.adaptive = true;
      options.integrator.absolute_tolerance = tolerance;
      options.integrator.relative_tolerance = tolerance;
      Plant plant(arm, options, joints({1.2, -1}), joints({1, 2}));
      Plant exact(arm, testing::precise(0.5), joints({1.2, -1}), joints({1, 2}));
      ASSERT_EQ(run(plant, 1), Status::kOk);
      ASSERT_EQ(run(exact, 1), Status::kOk);
      const double error = (state_of(plant) - state_of(exact)).norm();
      EXPECT_LT(error, 100 * tolerance) << name_of(method);
      EXPECT_GT(error, 10 * last_error) << name_of(method);
      last_error = error;
    }
  }
}

/// An oscillator that counts its evaluations.
class CountingOscillator : public LinearSystem {
 public:
  CountingOscillator() : LinearSystem(kOne, kZero, kOne) {}
  void rates(const StateVector& y, StateVector& y_dot) noexcept override {
    ++evaluations;
    LinearSystem::rates(y, y_dot);
    if (broken) y_dot.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  int evaluations = 0;
  bool broken = false;
};

/// Error over tolerance stays the same over eight decades, because the estimate has the order of
/// the method; and so does the work, which grows by 10^(1/8) a decade.
TEST(AdaptiveSteps, OfOrderEightEstimateTheirErrorWithItsOrder) {
  int last = 0;
  for (const double tolerance : {1e-6, 1e-8, 1e-10, 1e-12}) {
    IntegratorOptions options;
    options.method = Method::kDormandPrince8;
    options.adaptive = true;
    options.max_step = 10;
    options.absolute_tolerance = options.relative_tolerance = tolerance;
    Integrator integrator(options);
    CountingOscillator system;
    StateVector y = StateVector::Zero(2 + kWorkChannels);
    y[0] = 1;
    ASSERT_EQ(integrator.advance(system, 100, y), Status::kOk);
    const double error = std::hypot(y[0] - std::cos(100), y[1] + std::sin(100));
    EXPECT_LT(error, 20 * tolerance) << tolerance;
    EXPECT_GT(error, 5 * tolerance) << tolerance;
    if (last > 0) EXPECT_NEAR(system.evaluations / (last * std::pow(10, 2.0 / 8)), 1, 0.15);
    last = system.evaluations;
  }
}

TEST(AdaptiveSteps, GiveUpSoonWhereThereAreNoNumbersAndRecover) {
  for (const Method method : {Method::kDormandPrince8, Method::kRosenbrock}) {
    IntegratorOptions options;
    options.method = method;
    options.adaptive = true;
    Integrator integrator(options);
    CountingOscillator system;
    system.broken = true;
    StateVector y = StateVector::Zero(2 + kWorkChannels);
    y[0] = 1;
    EXPECT_NE(integrator.advance(system, 1, y), Status::kOk) << name_of(method);
    EXPECT_LT(system.evaluations, 1000) << name_of(method);
    system.broken = false;
    system.evaluations = 0;
    y[0] = std::numeric_limits<double>::infinity();
    EXPECT_NE(Integrator(options).advance(system, 1, y), Status::kOk) << name_of(method);
    EXPECT_LT(system.evaluations, 1000) << name_of(method);
    y.setZero();
    y[0] = 1;
    EXPECT_EQ(integrator.advance(system, 1, y), Status::kOk) << name_of(method);
    EXPECT_NEAR(y[0], std::cos(1), 1e-4) << name_of(method);
  }
}

TEST(Evaluations, AreNotMadeTwice) {
  const auto evaluations = [](Method method, bool adaptive) {
    IntegratorOptions options;
    options.method = method;
    options.max_step = 0.01;
    options.adaptive = adaptive;
    options.absolute_tolerance = 1;  // every step is as long as it may be
    Integrator integrator(options);
    CountingOscillator system;
    StateVector y = StateVector::Zero(2 + kWorkChannels);
    y[0] = 1;
    EXPECT_EQ(integrator.advance(system, 1, y), Status::kOk);
    EXPECT_NEAR(y[0], std::cos(1), 1e-2);
    return system.evaluations;
  };
  EXPECT_EQ(evaluations(Method::kSemiImplicitEuler, false), 100);
  EXPECT_EQ(evaluations(Method::kRungeKutta4, false), 400);
  EXPECT_EQ(evaluations(Method::kDormandPrince8, false), 1200);
  // One more finds the first step.
  EXPECT_EQ(evaluations(Method::kDormandPrince8, true), 1 + 12 * 100);
  EXPECT_EQ(evaluations(Method::kRosenbrock, true), 1 + 5 * 100);
}

TEST(AdaptiveSteps, GiveUpWhenThereAreTooMany) {
  Arm arm(testing::pendulum(2));
  PlantOptions options = testing::precise(0.5);
  options.integrator.max_steps = 3;
  Plant plant(arm, options, joints({1.2, -1}));
  EXPECT_EQ(run(plant, 1), Status::kTooManySteps);
  EXPECT_EQ(plant.position(), joints({1.2, -1}));
  EXPECT_EQ(plant.ticks(), 0);
}

TEST(Integrator, RefusesOptionsThatMakeNoSense) {
  IntegratorOptions none, all[4];
  all[0].max_step = 0;
  all[1].adaptive = true;
  all[2].absolute_tolerance = -1;
  all[3].max_steps = 0;
  EXPECT_NO_THROW(Integrator{none});
  for (const IntegratorOptions& options : all) EXPECT_THROW(Integrator{options}, InvalidScene);
}

}  // namespace
}  // namespace dashpot::sim
