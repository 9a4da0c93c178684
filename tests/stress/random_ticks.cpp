// Control ticks of a Panda at random states, one as little like the last as can be, with set-points
// that move all the time: what instruction_count.sh counts.
//     random_ticks joint|cartesian|blend TICKS
// Every 16th state is next to a singularity; `blend` changes gains, frame and mode at every tick.
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/robot_model.hpp>

#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

/// Where callgrind writes down what a tick took.
extern "C" [[gnu::noinline]] void end_of_tick() {
  asm volatile("");
}

namespace {

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)

Settings settings_for(const RobotModel& model) {
  Settings settings = default_settings(model);
  settings.analysis.where = Analysis::Where::kOff;
  settings.feed_forward.friction = true;
  settings.limits.velocity.setConstant(1e6);  // so that states may jump
  settings.motion.gain_time = 0.01;
  return settings;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::string kind = argv[1];
  const RobotModel model = RobotModel::from_urdf_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf",
                                                      "panda_link0", "panda_hand_tcp");
  const Settings settings = settings_for(model);
  Controller controller(model, settings);
  std::mt19937_64 engine(351);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  };
  RobotState state;
  state.position = state.velocity = settings.initial.joint_position;
  Setpoint setpoint = settings.initial;
  setpoint.mode = kind == "joint" ? Mode::kJoint : Mode::kCartesian;
  JointVector torque;
  Status worst = Status::kOk;
  for (int k = 0; k < std::atoi(argv[2]); ++k) {
    state.time += 1'000'000;
    for (Eigen::Index i = 0; i < 7; ++i) {
      const Limits& limits = settings.limits;
      state.position[i] = uniform(limits.position_lower[i] + 0.1, limits.position_upper[i] - 0.1);
      setpoint.joint_position[i] = uniform(limits.position_lower[i], limits.position_upper[i]);
      state.velocity[i] = uniform(-2, 2);
    }
    if (k % 16 == 0) state.position[1] = state.position[2] = uniform(-1e-4, 1e-4);
    setpoint.time = state.time;
    setpoint.tip_pose.position = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    if (kind == "blend") {
      setpoint.mode = k % 5 == 0 ? Mode::kJoint : Mode::kCartesian;
      setpoint.gains.frame = k % 2 == 0 ? Frame::kBase : Frame::kTool;
      setpoint.gains.task_stiffness(0, 0) = uniform(0, 1000);
      setpoint.wrench[2] = uniform(-10, 10);
    }
    worst = worse(worst, controller.update(state, setpoint, torque));
    end_of_tick();
  }
  std::fprintf(stderr, "random_ticks %s: %s\n", kind.c_str(), to_text(worst));
  return worst <= Status::kNearJointLimit ? 0 : 1;
}
