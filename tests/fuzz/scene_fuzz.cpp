// The input as a scene of `dashpot run`, and the simulation's first ticks.
#include <dashpot/apps/scene/scene.hpp>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)

void simulate(const apps::Scene& scene) {
  sim::Arm arm(scene.arm->robot, scene.arm->options);
  sim::Plant plant(arm, scene.plant, scene.start, scene.velocity);
  const sim::JointVector torque = sim::JointVector::Zero(scene.dof());
  for (int tick = 0; tick < 3; ++tick) {
    if (plant.step(torque) != sim::Status::kOk) return;
    fuzz::require(plant.position().allFinite() && plant.velocity().allFinite(),
                  "a good step ends somewhere");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::ScratchTree tree;
  const std::string path = tree.write("sim/scenes/scene.yaml", data, size);
  try {
    simulate(apps::load_scene(path));
  } catch (const apps::InputError&) {
  }
  return 0;
}
