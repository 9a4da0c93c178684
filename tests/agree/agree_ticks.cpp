// Prints the numbers of a fixed set of control ticks, one a line with its kind and name, in
// full: what builds by different compilers have to agree on (./run agree).
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/agree/agree_numbers.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/places.hpp>

#include <string>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)
using agree::print_all;

void ticks() {
  const auto model = controller::RobotModel::from_urdf_file(
      DASHPOT_SOURCE_DIR "/sim/models/panda.urdf", "panda_link0", "panda_hand_tcp");
  controller::Settings settings = controller::default_settings(model);
  settings.initial.mode = controller::Mode::kCartesian;
  controller::Controller loop(model, settings);
  controller::RobotState state;
  controller::Setpoint setpoint = settings.initial;
  controller::JointVector torque;
  for (int tick = 0; tick < 500; ++tick) {
    const double t = 1e-3 * tick;
    state.position = testing::swing(t);
    state.velocity = 1e4 * (testing::swing(t + 5e-5) - testing::swing(t - 5e-5));
    state.time = setpoint.time = tick * std::int64_t{1'000'000};
    if (tick == 0) {
      setpoint.joint_position = state.position;
      const auto dynamics = controller::evaluate(model, state.position, state.velocity);
      setpoint.tip_pose = {dynamics.p_BT_B, dynamics.R_BT};
    }
    loop.update(state, setpoint, torque);
    if (tick % 50 != 0) continue;
    print_all("torque", "tick." + std::to_string(tick), torque);
  }
}

}  // namespace

int main() {
  ticks();
  return 0;
}
