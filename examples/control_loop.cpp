#include <cstdio>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/robot_model.hpp>

using namespace dashpot::controller;

int main() {
  const RobotModel model =
      RobotModel::from_urdf_file("sim/models/panda.urdf", "panda_link0", "panda_hand_tcp");
  Controller controller(model, default_settings(model));
  RobotState state;  // SI units
  state.position.resize(7);
  state.position << 0, -0.785, 0, -2.356, 0, 1.571, 0.785;
  state.velocity.setZero(7);
  Setpoint setpoint = controller.settings().initial;
  setpoint.joint_position = state.position;
  JointVector torque;
  for (int tick = 0; tick < 1000; ++tick) {  // every millisecond, with what the robot reports
    state.time = setpoint.time = tick * 1'000'000;
    controller.update(state, setpoint, torque);  // a torque that is safe to send, and a status
  }
  for (int i = 0; i < controller.vibration().count; ++i)
    std::printf("%.2f rad/s, damping ratio %.2f\n",
                controller.vibration().modes[i].natural_frequency,
                controller.vibration().modes[i].damping_ratio);
}
