// Control ticks of a Panda at random states, each as different from the last as possible, with
// moving set-points, which instruction_count.sh counts.
//     random_ticks joint|cartesian|blend|modes|lost|still TICKS
// Every 16th state is next to a singularity; `blend` changes gains, frame and mode at every tick.
// The others find the modes in every tick: `modes` of a swinging arm, `lost` at random states,
// where no mode can be tracked and each tick ends in the direct solver, `still` of a trembling arm.
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/robot_model.hpp>
#include <dashpot/tests/support/places.hpp>

#include <cmath>
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

Settings settings_for(const RobotModel& model, bool modes) {
  Settings settings = default_settings(model);
  settings.analysis.where = modes ? Analysis::Where::kInline : Analysis::Where::kOff;
  settings.feed_forward.friction = true;
  settings.limits.beyond_model = true;
  settings.limits.velocity.setConstant(1e6);  // so that states may jump
  settings.limits.tip_velocity = 1e6;
  settings.limits.torque *= 1e3;  // and torques with them
  settings.limits.torque_rate *= 1e6;
  settings.watchdog.feedback = 0;
  settings.motion.gain_time = 0.01;
  return settings;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::string kind = argv[1];
  const RobotModel model = RobotModel::from_urdf_file(DASHPOT_SOURCE_DIR "/sim/models/panda.urdf",
                                                      "panda_link0", "panda_hand_tcp");
  const bool still = kind == "still", swinging = kind == "modes" || still;
  const bool modes = swinging || kind == "lost";
  const Settings settings = settings_for(model, modes);
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
    if (swinging) {
      for (Eigen::Index i = 0; i < 7; ++i) {
        const double phase = (2 + 0.3 * static_cast<double>(i)) * (still ? 0 : 1e-3 * k);
        const double middle = settings.limits.position_lower[i] + settings.limits.position_upper[i];
        state.position[i] = 0.5 * middle + 0.4 * std::sin(phase + static_cast<double>(i));
      }
      if (still) state.position[0] *= 1 + 1e-16 * (k % 3);
    } else if (k % 16 == 0) {
      state.position[1] = state.position[2] = uniform(-1e-4, 1e-4);
    }
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
  std::fprintf(stderr, "random_ticks %s: %s", kind.c_str(), to_text(worst));
  if (modes) {
    const VibrationCounters& counters = controller.vibration().counters;
    std::fprintf(stderr, "; modes tracked %llu, direct %llu, reused %llu",
                 static_cast<unsigned long long>(counters.tracked),
                 static_cast<unsigned long long>(counters.direct),
                 static_cast<unsigned long long>(counters.reused + counters.unchanged));
  }
  std::fprintf(stderr, "\n");
  return worst <= Status::kNearJointLimit ? 0 : 1;
}
