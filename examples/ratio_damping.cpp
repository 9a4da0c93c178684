// An arm led through its workspace by a spring at its tip: the controller designs the damping again
// at every tick, so that each mode keeps its damping ratio wherever the arm is.
#include <cstdio>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/robot_model.hpp>

using namespace dashpot::controller;

int main() {
  const auto model =
      RobotModel::from_urdf_file("sim/models/panda.urdf", "panda_link0", "panda_hand_tcp");
  Settings settings = default_settings(model);
  settings.initial.mode = Mode::kCartesian;
  Gains& gains = settings.initial.gains;
  gains.task_stiffness.diagonal() << 2000, 600, 2000, 100, 100, 100;  // N/m, N m/rad
  gains.task_damping_ratio = 0.7;
  gains.null_stiffness.setZero(7);  // the elbow stays free
  gains.null_damping.setZero(7);
  Controller controller(model, settings);
  RobotState state;
  state.position.resize(7);
  state.velocity.setZero(7);
  JointVector torque;
  for (int tick = 1; tick <= 2000; ++tick) {  // a slow way, as the robot would report it
    const double s = 1e-4 * tick;             // rad
    state.time = tick * 1'000'000;
    state.position << s, -0.785 + s, 0, -2.356 + 2 * s, 0, 1.571, 0.785;
    state.velocity << 0.1, 0.1, 0, 0.2, 0, 0, 0;  // rad/s
    Setpoint setpoint = controller.settings().initial;
    setpoint.time = state.time;
    setpoint.tip_pose = controller.snapshot().tip;  // where the arm is: the springs rest
    controller.update(state, setpoint, torque);
    if (tick % 1000 != 0) continue;
    const Vibration& vibration = controller.vibration();
    std::printf("%d ms:", tick);
    for (int i = 0; i < vibration.count; ++i)
      std::printf(" %.4f", vibration.modes[i].damping_ratio);
    std::printf("\n");
  }
}
