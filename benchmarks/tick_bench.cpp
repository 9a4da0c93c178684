// A whole control tick: state check, model, set-point path, law and safety, with all feed-forward
// and moving set-points. `tick/cartesian` has the null space if the arm is redundant, `tick/joint`
// is joint impedance. 6 joints are the UR5, 7 the Panda, 14 a random chain. The arm swings, and its
// state is a new one at every tick. `tick/full` has the spectrum of each as well, with shapes, and
// the snapshot; `tick/design` also keeps a damping ratio; `tick/elastic` is `tick/full` of an arm
// with elastic joints and 14 modes; `tick/loaded` has `control.load` and `jacobian_rate` on, under
// a wrench. `tick/paced` and `tick/evicted` are `tick/full` at the pace of 1 kHz, and after 64 MB
// of other data have passed through the caches. `footprint` exists under callgrind alone: a tick of
// each of these, see footprint.py.
#include <dashpot/benchmarks/one_by_one.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/tests/support/places.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <benchmark/benchmark.h>
#include <valgrind/callgrind.h>

#include <chrono>
#include <cmath>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace dashpot::controller;  // NOLINT(google-build-using-namespace)
using dashpot::benchmarks::time_one_by_one;

constexpr std::size_t kStates = 2048;  // one swing; its end meets its beginning
constexpr double kPeriod = 0.001;

RobotModel model_of(int n, bool elastic) {
  const std::string models = DASHPOT_SOURCE_DIR "/sim/models/";
  if (n == 6) return RobotModel::from_urdf_file(models + "ur5.urdf", "base_link", "ee_link");
  if (n == 7) {
    ModelOptions options;
    if (elastic) {
      options.drives = "fr3";
      options.gear_stiffness = JointVector::LinSpaced(7, 1e4, 3e3);  // N m/rad
      options.gear_damping = JointVector::LinSpaced(7, 1, 0.5);      // N m s/rad
    }
    return RobotModel::from_urdf_file(models + "panda.urdf", "panda_link0", "panda_hand_tcp",
                                      options);
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

/// Options of the loop.
struct Extra {
  double ratio = 0;      ///< damping ratio of the design; 0: none
  bool loaded = false;   ///< a load and `jacobian_rate` are in the modes
  bool elastic = false;  ///< with elastic joints
};

/// A controller in the loop with a swinging arm.
class Loop {
 public:
  Loop(int n, Mode mode, const Analysis& analysis, const Extra& extra = {})
      : Loop(model_of(n, extra.elastic), mode, analysis, extra) {}

  Status step() {
    RobotState& state = states_[k_];
    state.time = time_ += 1'000'000;
    setpoint_.time = time_;
    const bool up = k_ % 512 == 0;
    if (k_ % 256 == 0) setpoint_.tip_pose.position.z() += up ? 0.05 : -0.05;
    if (k_ % 256 == 0) setpoint_.joint_position[0] += up ? 0.1 : -0.1;
    k_ = k_ + 1 == kStates ? 0 : k_ + 1;
    const Status status = controller_.update(state, setpoint_, torque_);
    benchmark::DoNotOptimize(torque_.data());
    return status;
  }
  const Vibration& vibration() const { return controller_.vibration(); }

 private:
  Loop(const RobotModel& model, Mode mode, const Analysis& analysis, const Extra& extra)
      : controller_(model, settings_for(model, analysis, extra)) {
    setpoint_ = controller_.settings().initial;
    JointVector center = setpoint_.joint_position;
    if (model.dof() == 7) center << 0, -0.785, 0, -2.356, 0, 1.571, 0.785;
    states_ = swing(center);
    for (RobotState& state : states_) {
      if (extra.loaded) state.external_wrench << 20, -10, -30, 0, 1, 0.5;
    }
    setpoint_.mode = mode;
    setpoint_.joint_position = center;
    const DynamicsResult there = evaluate(model, center, JointVector::Zero(center.size()));
    setpoint_.tip_pose = {there.p_BT_B, there.R_BT};
    for (std::size_t i = 0; i < kStates; ++i) step();
  }
  static Settings settings_for(const RobotModel& model, const Analysis& analysis,
                               const Extra& extra) {
    Settings settings = default_settings(model);
    Gains& gains = settings.initial.gains;
    gains.task_damping_ratio = extra.ratio;
    if (extra.ratio == 0) {  // constant damping
      gains.joint_damping_ratio = gains.null_damping_ratio = 0;
      gains.joint_damping = 0.1 * gains.joint_stiffness;
      gains.task_damping = 0.1 * gains.task_stiffness;
      gains.null_damping = 0.1 * gains.null_stiffness;
    }
    if (extra.loaded) settings.task_terms = {Load::kBaseWrench, true};
    settings.analysis = analysis;
    settings.feed_forward.friction = true;
    settings.limits.beyond_model = true;
    settings.limits.torque *= 1e3;  // so that no limit is at work
    settings.limits.torque_rate *= 1e6;
    settings.limits.velocity *= 1e3;
    settings.limits.tip_velocity *= 1e3;
    return settings;
  }

  Controller controller_;
  std::vector<RobotState> states_;
  Setpoint setpoint_;
  JointVector torque_;
  std::int64_t time_ = 0;
  std::size_t k_ = 0;
};

void tick(benchmark::State& bench, Mode mode, const Analysis& analysis, const Extra& extra) {
  Loop loop(static_cast<int>(bench.range(0)), mode, analysis, extra);
  const VibrationCounters before = loop.vibration().counters;
  Status worst = Status::kOk;
  for (auto _ : bench) {
    worst = worse(worst, loop.step());
    benchmark::ClobberMemory();
  }
  if (worst != Status::kOk) bench.SkipWithError(to_text(worst));
  if (analysis.where != Analysis::Where::kInline) return;
  const VibrationCounters& counters = loop.vibration().counters;
  bench.counters["modes"] = loop.vibration().count;
  bench.counters["direct"] = static_cast<double>(counters.direct - before.direct);
  bench.counters["tracked"] = static_cast<double>(counters.tracked - before.tracked);
}

/// Each of the ticks timed by itself, after `prepare`.
template <class Prepare>
void one_by_one(benchmark::State& bench, const Analysis& analysis) {
  Loop loop(static_cast<int>(bench.range(0)), Mode::kCartesian, analysis);
  const std::uint64_t direct = loop.vibration().counters.direct;
  time_one_by_one(bench, Prepare(), [&] { loop.step(); });
  bench.counters["direct"] = static_cast<double>(loop.vibration().counters.direct - direct);
}

template <class Prepare>
void add_one_by_one(const std::string& name, const Analysis& analysis, int ticks) {
  benchmark::RegisterBenchmark(
      name.c_str(), [=](benchmark::State& bench) { one_by_one<Prepare>(bench, analysis); })
      ->Arg(7)
      ->Iterations(ticks)
      ->UseManualTime()
      ->Unit(benchmark::kMicrosecond);
}

/// Lets callgrind watch one tick, with caches that are empty at first.
void add_footprint(const std::string& name, Mode mode, const Analysis& analysis,
                   const Extra& extra = {}) {
  benchmark::RegisterBenchmark(("footprint/" + name).c_str(), [=](benchmark::State& bench) {
    Loop loop(7, mode, analysis, extra);
    const bool follows = analysis.where == Analysis::Where::kInline;
    const auto step_and_follow = [&] {
      const std::uint64_t tracked = loop.vibration().counters.tracked;
      loop.step();
      return !follows || loop.vibration().counters.tracked > tracked;
    };
    // Valgrind runs one thread at a time, and a spectrum may have to come from another.
    for (int tries = 0; !step_and_follow() && tries < 5000; ++tries) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    bool followed = false;
    for (auto _ : bench) {
      CALLGRIND_START_INSTRUMENTATION;
      followed = step_and_follow();
      CALLGRIND_STOP_INSTRUMENTATION;
    }
    if (!followed) {
      CALLGRIND_ZERO_STATS;
      return bench.SkipWithError("the modes are not followed in this tick");
    }
    CALLGRIND_DUMP_STATS_AT(name.c_str());
  })->Iterations(1);
}

void add(const std::string& name, Mode mode, Analysis analysis, std::initializer_list<int> joints,
         const Extra& extra = {}) {
  for (const int n : joints) {
    benchmark::RegisterBenchmark(
        name.c_str(), [=](benchmark::State& bench) { tick(bench, mode, analysis, extra); })
        ->Arg(n)
        ->Unit(benchmark::kMicrosecond);
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const Analysis off{Analysis::Where::kOff, 1, 0.1, 0.1, true, {}};
  const Analysis every_tick{Analysis::Where::kInline, 1, 0.1, 0.1, true, {}};
  add("tick/cartesian", Mode::kCartesian, off, {6, 7, 14});
  add("tick/joint", Mode::kJoint, off, {6, 7, 14});
  add("tick/full", Mode::kCartesian, every_tick,
      {2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16});
  add("tick/design", Mode::kCartesian, every_tick, {6, 7, 14}, {0.7});
  add("tick/loaded", Mode::kCartesian, every_tick, {7}, {0, true});
  add("tick/elastic", Mode::kCartesian, every_tick, {7}, {0, false, true});
  add("tick/full_joint", Mode::kJoint, every_tick, {6, 7, 14});
  add_one_by_one<dashpot::benchmarks::Paced>("tick/paced", every_tick, 2000);
  add_one_by_one<dashpot::benchmarks::Evicted>("tick/evicted", every_tick, 200);
  if (RUNNING_ON_VALGRIND != 0) {
    add_footprint("tick/joint/7", Mode::kJoint, off);
    add_footprint("tick/cartesian/7", Mode::kCartesian, off);
    add_footprint("tick/full/7", Mode::kCartesian, every_tick);
    add_footprint("tick/design/7", Mode::kCartesian, every_tick, {0.7});
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
