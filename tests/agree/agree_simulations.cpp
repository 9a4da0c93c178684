// Prints the numbers of a fixed set of simulations, one a line with its kind and name, in
// full: what builds by different compilers have to agree on (./run agree).
#include <dashpot/sim/arm.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/agree/agree_numbers.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/places.hpp>

#include <string>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)
using agree::print_all;

void simulations() {
  sim::Arm arm(sim::Robot::from_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0",
                                     "panda_hand_tcp"));
  for (const sim::Method method :
       {sim::Method::kSemiImplicitEuler, sim::Method::kRungeKutta4, sim::Method::kDormandPrince8,
        sim::Method::kImplicitMidpoint, sim::Method::kRosenbrock}) {
    for (const bool adaptive : {false, true}) {
      if (adaptive && !sim::estimates_error(method)) continue;
      sim::PlantOptions options;
      options.integrator.method = method;
      options.integrator.adaptive = adaptive;
      sim::Plant plant(arm, options, testing::swing(0));
      const sim::JointVector torque = sim::JointVector::Constant(7, 0.5);
      for (int tick = 0; tick < 500; ++tick) plant.step(torque);
      const std::string name = "simulation." + std::to_string(static_cast<int>(method)) +
                               (adaptive ? ".adaptive" : ".fixed");
      const bool numerical = method == sim::Method::kRosenbrock;
      print_all(numerical ? "numerical_motion" : "motion", name, plant.position());
    }
  }
}

}  // namespace

int main() {
  simulations();
  return 0;
}
