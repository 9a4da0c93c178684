// Run time against error: a second of a Panda that an impedance controller holds and lets go, soft,
// ordinary and stiff, with every integrator of sim/, with Boost.Odeint's steppers on the same
// right-hand side (except rosenbrock4, because Boost 1.74's does not compile as C++20), and with
// MuJoCo on the same robot. Names: simulation/GAINS/WHOSE/METHOD/STEPS or /TOLERANCE; `error` is
// the largest of the joints' after the second, rad, against a solution on which two methods of
// different families agree to `reference`.
#include <dashpot/benchmarks/released_panda.hpp>
#include <dashpot/sim/integrator.hpp>
#ifdef DASHPOT_HAVE_MUJOCO
#include <dashpot/benchmarks/mujoco_panda.hpp>
#endif

#include <benchmark/benchmark.h>

#include <algorithm>
#include <boost/numeric/odeint.hpp>
#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <functional>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace odeint = boost::numeric::odeint;
using namespace dashpot;  // NOLINT(google-build-using-namespace)
using bench::ReleasedPanda;
using State = ReleasedPanda::State;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kEnd = 1;         // s
constexpr double kHopeless = 0.1;  // rad; such a result is useless
constexpr std::array<int, 22> kSteps = {4,  5,  6,  8,  10,  12,  14,  16,  20,   25,   32,
                                        40, 50, 64, 80, 100, 160, 256, 512, 1000, 2000, 4000};
constexpr std::array<double, 16> kTolerances = {1,    3e-1, 1e-1, 3e-2, 1e-2, 3e-3, 1e-3,  3e-4,
                                                1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11};

/// From the start to the end of the second; not finite if it fails.
using Solve = std::function<State(ReleasedPanda& panda)>;

// ------------------------------------------------------------------------------------------ ours

State run_ours(ReleasedPanda& panda, const sim::IntegratorOptions& options) {
  sim::Integrator integrator(options);
  State y = ReleasedPanda::start();
  sim::StateVector state = sim::StateVector::Zero(2 * ReleasedPanda::kJoints + sim::kWorkChannels);
  std::copy(y.begin(), y.end(), state.data());
  if (integrator.advance(panda, kEnd, state) != sim::Status::kOk) state.setConstant(kInfinity);
  std::copy_n(state.data(), y.size(), y.begin());
  return y;
}

Solve ours(sim::Method method, int steps) {
  sim::IntegratorOptions options;
  options.method = method;
  options.max_step = kEnd / steps;
  return [options](ReleasedPanda& panda) { return run_ours(panda, options); };
}

Solve ours_adaptive(sim::Method method, double tolerance) {
  sim::IntegratorOptions options;
  options.method = method;
  options.max_step = kEnd;
  options.adaptive = true;
  options.absolute_tolerance = options.relative_tolerance = tolerance;
  return [options](ReleasedPanda& panda) { return run_ours(panda, options); };
}

// ---------------------------------------------------------------------------------------- odeint

auto right_hand_side(ReleasedPanda& panda) {
  return
      [&panda](const State& y, State& y_dot, double) { panda.derivative(y.data(), y_dot.data()); };
}

/// A stepper that is new in each run: some remember earlier steps.
template <class Stepper>
Solve odeint_fixed(int steps) {
  return [steps](ReleasedPanda& panda) {
    State y = ReleasedPanda::start();
    Stepper stepper;
    odeint::integrate_n_steps(stepper, right_hand_side(panda), y, 0.0, kEnd / steps,
                              static_cast<std::size_t>(steps));
    return y;
  };
}

template <class Stepper>
State run_controlled(Stepper stepper, ReleasedPanda& panda) {
  constexpr double kFirstStep = 1e-3;
  State y = ReleasedPanda::start();
  try {
    odeint::integrate_adaptive(stepper, right_hand_side(panda), y, 0.0, kEnd, kFirstStep);
  } catch (const std::exception&) {
    y.fill(kInfinity);
  }
  return y;
}

template <class Stepper>
Solve odeint_adaptive(double tolerance) {
  return [tolerance](ReleasedPanda& panda) {
    return run_controlled(odeint::make_controlled(tolerance, tolerance, Stepper()), panda);
  };
}

Solve bulirsch_stoer(double tolerance) {
  return [tolerance](ReleasedPanda& panda) {
    return run_controlled(odeint::bulirsch_stoer<State>(tolerance, tolerance), panda);
  };
}

/// Accelerations that depend on velocities use the velocities of the step before.
Solve odeint_verlet(int steps) {
  using Half = std::array<double, ReleasedPanda::kJoints>;
  using Stepper =
      odeint::velocity_verlet<Half, Half, double, Half, double, double, odeint::array_algebra>;
  return [steps](ReleasedPanda& panda) {
    State y = ReleasedPanda::start();
    const auto middle = y.begin() + ReleasedPanda::kJoints;
    std::pair<Half, Half> halves;
    std::copy(y.begin(), middle, halves.first.begin());
    std::copy(middle, y.end(), halves.second.begin());
    Stepper stepper;
    const auto acceleration = [&panda](const Half& q, const Half& qd, Half& qdd, double) {
      State at, rate;
      std::copy(qd.begin(), qd.end(), std::copy(q.begin(), q.end(), at.begin()));
      panda.derivative(at.data(), rate.data());
      std::copy(rate.begin() + ReleasedPanda::kJoints, rate.end(), qdd.begin());
    };
    for (int i = 0; i < steps; ++i)
      stepper.do_step(acceleration, halves, i * kEnd / steps, kEnd / steps);
    std::copy(halves.first.begin(), halves.first.end(), y.begin());
    return y;
  };
}

// ----------------------------------------------------------------------------------- measurement

double largest_difference(const State& a, const State& b) {
  double largest = 0;
  for (std::size_t i = 0; i < ReleasedPanda::kJoints; ++i) {
    const double difference = std::abs(a[i] - b[i]);
    if (!(difference <= largest)) largest = std::isnan(difference) ? kInfinity : difference;
  }
  return largest;
}

struct Reference {
  State end{};
  double agreement = 0;
};

const Reference& reference(double gain) {
  static std::map<double, Reference> known;
  const auto [place, is_new] = known.try_emplace(gain);
  if (is_new) {
    ReleasedPanda panda(gain);
    constexpr double kTight = 1e-13;
    place->second.end = ours_adaptive(sim::Method::kDormandPrince8, kTight)(panda);
    place->second.agreement = largest_difference(place->second.end, bulirsch_stoer(kTight)(panda));
  }
  return place->second;
}

void measure(benchmark::State& state, double gain, double error, const Solve& solve) {
  ReleasedPanda panda(gain);
  long runs = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(solve(panda));
    ++runs;
  }
  state.counters["error"] = error;
  state.counters["reference"] = reference(gain).agreement;
  state.counters["evaluations"] =
      static_cast<double>(panda.evaluations()) / static_cast<double>(runs);
}

/// Registers runs that come near the solution.
void add(const std::string& gains, double gain, const std::string& name, const Solve& solve) {
  ReleasedPanda panda(gain);
  const double error = largest_difference(solve(panda), reference(gain).end);
  if (!(error < kHopeless)) return;
  benchmark::RegisterBenchmark(("simulation/" + gains + "/" + name).c_str(),
                               [=](benchmark::State& state) { measure(state, gain, error, solve); })
      ->Unit(benchmark::kMicrosecond);
}

std::string text(double number) {
  std::ostringstream stream;
  stream << number;
  return stream.str();
}

template <int Order>
using Adams =
    odeint::adams_bashforth_moulton<Order, State, double, State, double, odeint::array_algebra,
                                    odeint::default_operations, odeint::initially_resizer,
                                    odeint::runge_kutta_fehlberg78<State>>;

void add_fixed(const std::string& gains, double gain, int steps) {
  const std::string end = "/" + std::to_string(steps);
  for (const auto& [name, method] :
       {std::pair("semi_implicit_euler", sim::Method::kSemiImplicitEuler),
        {"rk4", sim::Method::kRungeKutta4},
        {"dormand_prince_8", sim::Method::kDormandPrince8},
        {"implicit_midpoint", sim::Method::kImplicitMidpoint},
        {"rosenbrock", sim::Method::kRosenbrock}}) {
    const bool implicit =
        method == sim::Method::kImplicitMidpoint || method == sim::Method::kRosenbrock;
    if (implicit && steps > 1000) continue;  // takes long
    add(gains, gain, "ours/" + std::string(name) + end, ours(method, steps));
  }
  const auto rival = [&](const char* name, const Solve& solve) {
    add(gains, gain, "odeint/" + std::string(name) + end, solve);
  };
  rival("rk4", odeint_fixed<odeint::runge_kutta4<State>>(steps));
  rival("dopri5", odeint_fixed<odeint::runge_kutta_dopri5<State>>(steps));
  rival("cash_karp54", odeint_fixed<odeint::runge_kutta_cash_karp54<State>>(steps));
  rival("fehlberg78", odeint_fixed<odeint::runge_kutta_fehlberg78<State>>(steps));
  rival("modified_midpoint", odeint_fixed<odeint::modified_midpoint<State>>(steps));
  rival("adams4", odeint_fixed<Adams<4>>(steps));
  rival("adams8", odeint_fixed<Adams<8>>(steps));
  rival("verlet", odeint_verlet(steps));
}

void add_adaptive(const std::string& gains, double gain, double tolerance) {
  const std::string end = "/" + text(tolerance);
  for (const auto& [name, method] : {std::pair("dormand_prince_8", sim::Method::kDormandPrince8),
                                     {"rosenbrock", sim::Method::kRosenbrock}}) {
    if (method == sim::Method::kRosenbrock && tolerance < 1e-6) continue;  // takes long
    add(gains, gain, "ours/adaptive_" + std::string(name) + end, ours_adaptive(method, tolerance));
  }
  const auto rival = [&](const char* name, const Solve& solve) {
    add(gains, gain, "odeint/adaptive_" + std::string(name) + end, solve);
  };
  rival("dopri5", odeint_adaptive<odeint::runge_kutta_dopri5<State>>(tolerance));
  rival("cash_karp54", odeint_adaptive<odeint::runge_kutta_cash_karp54<State>>(tolerance));
  rival("fehlberg78", odeint_adaptive<odeint::runge_kutta_fehlberg78<State>>(tolerance));
  rival("bulirsch_stoer", bulirsch_stoer(tolerance));
}

#ifdef DASHPOT_MUJOCO_NAME  // a second version of MuJoCo, without the other methods
constexpr bool kOnlyMujoco = true;
#else
constexpr bool kOnlyMujoco = false;
#define DASHPOT_MUJOCO_NAME "mujoco"
#endif

#ifdef DASHPOT_HAVE_MUJOCO
void add_mujoco(const std::string& gains, double gain, int steps) {
  for (const auto& [name, kind] :
       {std::pair("euler", mjINT_EULER), {"rk4", mjINT_RK4}, {"implicit", mjINT_IMPLICIT}}) {
    const auto panda = std::make_shared<bench::MujocoPanda>(gain, kind, kEnd / steps);
    const Solve solve = [panda, steps](ReleasedPanda& ours) { return panda->run(ours, steps); };
    add(gains, gain, DASHPOT_MUJOCO_NAME "/" + std::string(name) + "/" + std::to_string(steps),
        solve);
  }
}
#endif

}  // namespace

int main(int argc, char** argv) {  // NOLINT(bugprone-exception-escape): of set-up
  for (const auto& [name, gain] : {std::pair("soft", 1e2), {"ordinary", 1e3}, {"stiff", 1e5}}) {
    for (const int steps : kSteps) {
      if (!kOnlyMujoco) add_fixed(name, gain, steps);
#ifdef DASHPOT_HAVE_MUJOCO
      add_mujoco(name, gain, steps);
#endif
    }
    for (const double tolerance : kTolerances) {
      if (!kOnlyMujoco) add_adaptive(name, gain, tolerance);
    }
  }
  benchmark::Initialize(&argc, argv);
#ifdef DASHPOT_HAVE_MUJOCO
  benchmark::AddCustomContext(DASHPOT_MUJOCO_NAME, mj_versionString());
#endif
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
