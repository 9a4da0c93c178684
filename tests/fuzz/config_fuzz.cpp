// The input as a configuration file of the controller, and the controller's first ticks.
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/tests/fuzz/fuzz_input.hpp>

namespace {

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)
using dashpot::fuzz::require;

void drive(const Config& config) {
  Controller controller(config.model, config.settings);
  RobotState state;
  Setpoint setpoint = config.settings.initial;
  state.position = setpoint.joint_position;
  state.velocity.setZero(config.model.dof());
  JointVector torque;
  const Limits& limits = controller.settings().limits;
  for (int tick = 0; tick < 5; ++tick) {
    state.time = setpoint.time = tick * 1'000'000;
    controller.update(state, setpoint, torque);
    require(torque.size() == config.model.dof() && torque.allFinite() &&
                (torque.array().abs() <= limits.torque.array()).all(),
            "every torque is finite and within its limit");
    state.position[0] += 1e-4;
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const dashpot::fuzz::ScratchTree tree;
  const std::string path = tree.write("controller/examples/config.yaml", data, size);
  try {
    drive(load_config(path));
  } catch (const InputError&) {
  }
  return 0;
}
