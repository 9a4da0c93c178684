// A whole control tick: state check, model, set-point path, law and safety, with all feed-forward
// and moving set-points. `tick/cartesian` has the null space where the arm is redundant,
// `tick/joint` is joint impedance. 6 joints are the UR5, 7 the Panda, 14 a random chain. The arm
// swings, and its state is a new one at every tick.
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace {

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)

constexpr std::size_t kStates = 2048;  // one swing; its end meets its beginning
constexpr double kPeriod = 0.001;

RobotModel model_of(int n) {
  const std::string models = DASHPOT_SOURCE_DIR "/sim/models/";
  if (n == 6) return RobotModel::from_urdf_file(models + "ur5.urdf", "base_link", "ee_link");
  if (n == 7) {
    return RobotModel::from_urdf_file(models + "panda.urdf", "panda_link0", "panda_hand_tcp");
  }
  dashpot::testing::RandomRobot random(20210001);
  return RobotModel::from_urdf_text(random.chain(n, 0), "link0", "tip");
}

/// Swings of 0.2 rad about `center`, one of `kStates` periods.
std::vector<RobotState> swing(const JointVector& center) {
  std::vector<RobotState> states(kStates);
  for (std::size_t k = 0; k < kStates; ++k) {
    const double rate = 2 * std::numbers::pi / static_cast<double>(kStates);  // 1/tick
    states[k].position = states[k].velocity = center;
    for (Eigen::Index i = 0; i < center.size(); ++i) {
      const double phase = rate * static_cast<double>(k) + static_cast<double>(i);
      states[k].position[i] = center[i] + 0.2 * std::sin(phase);
      states[k].velocity[i] = 0.2 * rate / kPeriod * std::cos(phase);
    }
  }
  return states;
}

void tick(benchmark::State& bench, Mode mode, Analysis analysis) {
  const RobotModel model = model_of(static_cast<int>(bench.range(0)));
  Settings settings = default_settings(model);
  settings.analysis = analysis;
  settings.feed_forward.friction = true;
  settings.limits.torque *= 1e3;  // so that no limit is at work
  settings.limits.torque_rate *= 1e6;
  Controller controller(model, settings);

  JointVector center = settings.initial.joint_position;
  if (model.dof() == 7) center << 0, -0.785, 0, -2.356, 0, 1.571, 0.785;
  std::vector<RobotState> states = swing(center);
  Setpoint setpoint = settings.initial;
  setpoint.mode = mode;
  setpoint.joint_position = center;
  const DynamicsResult there = evaluate(model, center, JointVector::Zero(center.size()));
  setpoint.tip_pose = {there.p_BT_B, there.R_BT};

  JointVector torque;
  std::int64_t time = 0;
  std::size_t k = 0;
  const auto step = [&] {
    RobotState& state = states[k];
    state.time = time += 1'000'000;
    setpoint.time = time;
    if (k % 256 == 0) setpoint.tip_pose.position.z() += k % 512 == 0 ? 0.05 : -0.05;
    if (k % 256 == 0) setpoint.joint_position[0] += k % 512 == 0 ? 0.1 : -0.1;
    k = k + 1 == kStates ? 0 : k + 1;
    return controller.update(state, setpoint, torque);
  };
  for (std::size_t i = 0; i < kStates; ++i) step();
  Status worst = Status::kOk;
  for (auto _ : bench) {
    worst = worse(worst, step());
    benchmark::DoNotOptimize(torque.data());
    benchmark::ClobberMemory();
  }
  if (worst != Status::kOk) bench.SkipWithError(to_text(worst));
}

void add(const std::string& name, Mode mode, Analysis analysis, std::initializer_list<int> joints) {
  for (const int n : joints) {
    benchmark::RegisterBenchmark(name.c_str(),
                                 [=](benchmark::State& bench) { tick(bench, mode, analysis); })
        ->Arg(n)
        ->Unit(benchmark::kMicrosecond);
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const Analysis off{Analysis::Where::kOff, 1, 0.1};
  const Analysis every_tick{Analysis::Where::kInline, 1, 0.1};
  add("tick/cartesian", Mode::kCartesian, off, {6, 7, 14});
  add("tick/joint", Mode::kJoint, off, {6, 7, 14});
  add("tick/full", Mode::kCartesian, every_tick, {7});
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
