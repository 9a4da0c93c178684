// A millisecond of a simulated arm under held torque: sim/METHOD/ARM, with the factor of real time.
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/support/places.hpp>

#include <benchmark/benchmark.h>

#include <array>
#include <string>

namespace {

using namespace dashpot::sim;  // NOLINT(google-build-using-namespace)

struct Model {
  const char* name;
  const char* base;
  const char* tip;
};
constexpr std::array<Model, 4> kModels = {{{"panda", "panda_link0", "panda_hand_tcp"},
                                           {"iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka"},
                                           {"ur5", "base_link", "ee_link"},
                                           {"baxter_left", "left_arm_mount", "left_gripper"}}};

struct Stepper {
  const char* name;
  Method method;
};
constexpr std::array<Stepper, 6> kSteppers = {{{"semi_implicit_euler", Method::kSemiImplicitEuler},
                                               {"rk4", Method::kRungeKutta4},
                                               {"dormand_prince", Method::kDormandPrince},
                                               {"dormand_prince_8", Method::kDormandPrince8},
                                               {"implicit_midpoint", Method::kImplicitMidpoint},
                                               {"rosenbrock", Method::kRosenbrock}}};

/// Swings under its weight from rest, and starts again before it is fast.
void simulate(benchmark::State& state, const Model& model, const Stepper& stepper) {
  constexpr int kTicks = 200;
  const Robot robot =
      Robot::from_file(std::string(DASHPOT_SOURCE_DIR) + "/sim/models/" + model.name + ".urdf",
                       model.base, model.tip);
  Arm arm(robot);
  PlantOptions options;
  options.integrator.method = stepper.method;
  const JointVector q = JointVector::LinSpaced(robot.dof(), 0.2, -0.9);
  const JointVector torque = JointVector::Zero(robot.dof());
  std::int64_t ticks = 0;
  while (state.KeepRunningBatch(kTicks)) {
    Plant plant(arm, options, q);
    for (int i = 0; i < kTicks; ++i) {
      if (plant.step(torque) != Status::kOk) return state.SkipWithError("the simulation failed");
    }
    ticks += kTicks;
  }
  state.counters["times_real_time"] =
      benchmark::Counter(static_cast<double>(ticks) * options.period, benchmark::Counter::kIsRate);
}

const bool kRegistered = [] {
  for (const Model& model : kModels) {
    for (const Stepper& stepper : kSteppers) {
      benchmark::RegisterBenchmark(
          ("sim/" + std::string(stepper.name) + "/" + model.name).c_str(),
          [model, stepper](benchmark::State& state) { simulate(state, model, stepper); });
    }
  }
  return true;
}();

}  // namespace
