// M, C(q, qd) qd, gravity torque, J, Jdot qd and the tip's pose at one state: Dashpot's kernel
// beside KDL's solvers for the same, and Pinocchio's where its headers are found, on the same
// chain; each of Pinocchio's functions by itself, too. 7 joints are the Panda; other numbers are
// random chains of revolute joints. The largest difference from KDL, relative to the largest entry
// of each term, is printed beside each time.
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/kdl_dynamics.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#ifdef DASHPOT_HAVE_PINOCCHIO
#include <dashpot/benchmarks/pinocchio_chain.hpp>
#endif

namespace {

using dashpot::controller::DynamicsKernel;
using dashpot::controller::DynamicsResult;
using dashpot::controller::JointVector;
using dashpot::controller::RobotModel;
using dashpot::testing::KdlDynamics;
using dashpot::testing::RandomRobot;

constexpr unsigned kSeed = 20210001;
constexpr std::size_t kStates = 64;  // taken in turn, so that no branch is learnt

std::string chain_text(int n) {
  return RandomRobot(kSeed + static_cast<unsigned>(n)).chain(n, 0);
}

RobotModel model_of(int n) {
  if (n == 7) {
    return RobotModel::from_urdf_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0",
                                      "panda_hand_tcp");
  }
  return RobotModel::from_urdf_text(chain_text(n), "link0", "tip");
}

struct State {
  JointVector q, qd;
};

std::vector<State> states(int n) {
  RandomRobot random(kSeed);
  std::vector<State> all(kStates);
  for (State& state : all) {
    state.q = JointVector::NullaryExpr(n, [&] { return random.uniform(-3, 3); });
    state.qd = JointVector::NullaryExpr(n, [&] { return random.uniform(-1, 1); });
  }
  return all;
}

template <class A, class B>
double difference(const A& a, const B& b) {
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

double largest_difference(const DynamicsResult& a, const DynamicsResult& b) {
  return std::max({difference(a.M, b.M), difference(a.coriolis, b.coriolis),
                   difference(a.gravity, b.gravity), difference(a.J, b.J),
                   difference(a.Jdot_qd, b.Jdot_qd), difference(a.p_BT_B, b.p_BT_B),
                   difference(a.R_BT, b.R_BT)});
}

void dashpot_kernel(benchmark::State& state, int n) {
  const RobotModel model = model_of(n);
  const DynamicsKernel kernel(model);
  const std::vector<State> inputs = states(n);
  DynamicsResult result;
  std::size_t i = 0;
  for (auto _ : state) {
    kernel.evaluate(inputs[i].q, inputs[i].qd, result);
    benchmark::DoNotOptimize(&result);
    benchmark::ClobberMemory();
    i = (i + 1) % kStates;
  }
  KdlDynamics kdl(model);
  double worst = 0;
  for (const auto& [q, qd] : inputs) {
    kernel.evaluate(q, qd, result);
    kdl.solve(q, qd);
    worst = std::max(worst, largest_difference(result, kdl.result()));
  }
  state.counters["difference"] = worst;
}

void kdl(benchmark::State& state, int n) {
  KdlDynamics solvers(model_of(n));
  const std::vector<State> inputs = states(n);
  std::size_t i = 0;
  for (auto _ : state) {
    solvers.solve(inputs[i].q, inputs[i].qd);
    benchmark::ClobberMemory();
    i = (i + 1) % kStates;
  }
}

#ifdef DASHPOT_HAVE_PINOCCHIO
using dashpot::bench::PinocchioChain;
using Eigen::VectorXd;

/// Times `call(chain, q, qd)`.
template <class Call>
void pinocchio_call(benchmark::State& state, int n, Call call) {
  const RobotModel model = model_of(n);
  PinocchioChain chain(model);
  std::vector<std::pair<VectorXd, VectorXd>> inputs;
  for (const State& one : states(n)) inputs.emplace_back(one.q, one.qd);
  std::size_t i = 0;
  for (auto _ : state) {
    call(chain, inputs[i].first, inputs[i].second);
    benchmark::ClobberMemory();
    i = (i + 1) % kStates;
  }
  KdlDynamics kdl(model);
  double worst = 0;
  for (const auto& [q, qd] : inputs) {
    chain.all(q, qd);
    kdl.solve(q, qd);
    worst = std::max(worst, largest_difference(chain.result(), kdl.result()));
  }
  state.counters["difference"] = worst;
}

void add_pinocchio(int n) {
  const auto add = [n](const std::string& what, auto call) {
    const std::string name = "dynamics/pinocchio" + what + "/" + std::to_string(n);
    benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
      pinocchio_call(state, n, call);
    })->Unit(benchmark::kMicrosecond);
  };
  add("", [](auto& chain, auto& q, auto& qd) { chain.all(q, qd); });
  if (n != 7) return;
  add("_mass", [](auto& chain, auto& q, auto&) { chain.mass(q); });
  add("_bias", [](auto& chain, auto& q, auto& qd) { chain.bias(q, qd); });
  add("_gravity", [](auto& chain, auto& q, auto&) { chain.gravity(q); });
  add("_jacobian", [](auto& chain, auto& q, auto&) { chain.jacobian(q); });
  add("_jacobian_rate", [](auto& chain, auto& q, auto& qd) { chain.jacobian_rate(q, qd); });
  add("_bias_acceleration", [](auto& chain, auto& q, auto& qd) { chain.bias_acceleration(q, qd); });
  add("_pose", [](auto& chain, auto& q, auto&) { chain.pose(q); });
}
#endif

void add(int n) {
  const std::string joints = std::to_string(n);
  benchmark::RegisterBenchmark(("dynamics/dashpot/" + joints).c_str(), dashpot_kernel, n)
      ->Unit(benchmark::kMicrosecond);
  benchmark::RegisterBenchmark(("dynamics/kdl/" + joints).c_str(), kdl, n)
      ->Unit(benchmark::kMicrosecond);
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (int n = 2; n <= 16; ++n) add(n);
#ifdef DASHPOT_HAVE_PINOCCHIO
  benchmark::AddCustomContext("Pinocchio", PINOCCHIO_VERSION);
  for (int n = 2; n <= 16; ++n) add_pinocchio(n);
#endif
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
