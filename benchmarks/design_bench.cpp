// Full task-space damping for one target ratio at a new configuration, six task directions:
// design/full/n, warm-started along a path of a thousand configurations as in the control loop;
// design/friction/n also subtracts joint friction, and design/joint/n has springs in the joints.
// design/region/n designs one matrix for 32 configurations of n joints on one thread, and
// design/map/n only evaluates one there; items_per_second counts configurations.
// design/loop/n/d designs for a sampled loop with friction, a low-pass and d ticks of delay, whose
// achievable damping is below the target; in design/hopeless/n/d no damping keeps the margin.
// contact/limit/n/d computes the stable contact stiffness of such a loop along one direction, and
// contact/proved/n/d also its bracket.
#include <dashpot/analysis/contact_limit.hpp>
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/analysis/spectrum.hpp>

#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <random>
#include <utility>
#include <vector>

namespace {

using dashpot::analysis::DampingTarget;
using dashpot::analysis::kMaxDof;
using dashpot::analysis::RatioDamping;
using dashpot::analysis::Square;
using dashpot::analysis::Status;
using dashpot::analysis::TaskJacobian;
using dashpot::analysis::TaskMatrix;

constexpr double kRatio = 0.7;

/// M and J of an arm's size that swing with 0.5 rad at about 1 rad/s, sampled at 1 kHz.
struct Path {
  std::vector<Square<kMaxDof>> mass;
  std::vector<TaskJacobian<kMaxDof>> jacobian;
  TaskMatrix stiffness;

  explicit Path(Eigen::Index n) {
    std::mt19937_64 generator(20210001);
    std::normal_distribution<double> normal;
    const auto random = [&](Eigen::Index rows, Eigen::Index cols) {
      return Eigen::MatrixXd(
          Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(generator); }));
    };
    const Eigen::MatrixXd root = random(n, n), swing = random(n, n), J = random(6, n),
                          J_swing = random(6, n);
    for (int tick = 0; tick < 1000; ++tick) {
      const double angle = 0.5 * std::sin(1e-3 * tick);
      const Eigen::MatrixXd R = root + angle * swing;
      mass.emplace_back(R * R.transpose() / static_cast<double>(n) +
                        0.1 * Eigen::MatrixXd::Identity(n, n));
      jacobian.emplace_back(0.4 * (J + angle * J_swing));
    }
    stiffness = Eigen::Matrix<double, 6, 1>(2000, 600, 2000, 100, 100, 100).asDiagonal();
  }
};

void full(benchmark::State& state, bool friction) {
  const Path path(state.range(0));
  RatioDamping damper(DampingTarget::constant(kRatio));
  if (friction) damper.set_friction(Eigen::VectorXd::Ones(state.range(0)));
  damper.set_stiffness(path.stiffness);
  TaskMatrix C_C;
  std::size_t tick = 0;
  for (auto _ : state) {
    const Status status = damper.update(path.mass[tick], path.jacobian[tick], C_C);
    if (status != Status::kOk) state.SkipWithError("no damping found");
    benchmark::DoNotOptimize(C_C.data());
    tick = (tick + 1) % path.mass.size();
  }
}

void joint(benchmark::State& state) {
  const Path path(state.range(0));
  dashpot::analysis::RatioDamping damper;
  damper.set_target(DampingTarget::constant(kRatio));
  damper.set_stiffness(500 * Eigen::MatrixXd::Identity(state.range(0), state.range(0)));
  Square<kMaxDof> C(state.range(0), state.range(0));
  std::size_t tick = 0;
  for (auto _ : state) {
    if (damper.update(path.mass[tick], C) != Status::kOk) state.SkipWithError("no damping found");
    benchmark::DoNotOptimize(C.data());
    tick = (tick + 1) % path.mass.size();
  }
}

/// Returns evenly spaced configurations of the path.
std::vector<dashpot::analysis::TaskImpedance> configurations(Eigen::Index n) {
  constexpr std::size_t kCount = 32;
  const Path path(n);
  std::vector<dashpot::analysis::TaskImpedance> result(kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    const std::size_t tick = i * path.mass.size() / kCount;
    result[i].mass = path.mass[tick];
    result[i].jacobian = path.jacobian[tick];
    result[i].task_stiffness = path.stiffness;
  }
  return result;
}

void region(benchmark::State& state, bool design) {
  const auto all = configurations(state.range(0));
  dashpot::analysis::RegionOptions options;
  options.target = DampingTarget::constant(kRatio);
  options.threads = 1;
  const Eigen::MatrixXd damping = design_damping(all[0], options.target).damping;
  double level = 0;
  for (auto _ : state) {
    level =
        design ? design_region(all, options).level : evaluate_region(all, damping, options).level;
  }
  state.counters["level"] = level;
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(all.size()));
}

/// `speed`: fastest natural frequency times the loop's dead time.
void sampled(benchmark::State& state, double speed) {
  dashpot::analysis::TaskImpedance arm = configurations(state.range(0)).front();
  const double fastest =
      design_damping(arm, DampingTarget::constant(kRatio)).spectrum.modes[0].natural_frequency;
  dashpot::analysis::LoopLimit limit;
  limit.loop.delay = static_cast<int>(state.range(1));
  limit.loop.period = speed / fastest / (limit.loop.delay + 1.5);
  limit.loop.torque_cutoff = 0.1 / limit.loop.period;
  limit.loop.friction = Eigen::MatrixXd::Identity(arm.mass.rows(), arm.mass.rows());
  arm.damping = limit.loop.friction;
  double level = 0;
  for (auto _ : state) {
    level = design_damping(arm, DampingTarget::constant(1.5), limit).level;
  }
  state.counters["level"] = level;
}

void contact(benchmark::State& state, bool proved) {
  const dashpot::analysis::TaskImpedance arm = configurations(state.range(0)).front();
  const auto design = design_damping(arm, DampingTarget::constant(kRatio));
  const auto system = to_joint_space(with_damping(arm, design.damping));
  const auto spectrum = dashpot::analysis::analyze(system);
  dashpot::analysis::SampledLoop loop;
  loop.delay = static_cast<int>(state.range(1));
  dashpot::analysis::Touch touch;
  touch.direction = arm.jacobian->row(0).transpose();
  double limit = 0;
  for (auto _ : state) {
    limit = contact_limit(system, spectrum, loop, touch, proved).stiffness;
  }
  state.counters["limit"] = limit;
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  for (const int n : {6, 7, 12, 16}) {
    benchmark::RegisterBenchmark("design/full", full, false)->Arg(n);
    benchmark::RegisterBenchmark("design/friction", full, true)->Arg(n);
    benchmark::RegisterBenchmark("design/joint", joint)->Arg(n);
  }
  for (const bool design : {true, false}) {
    benchmark::RegisterBenchmark(design ? "design/region" : "design/map", region, design)
        ->Arg(7)
        ->Unit(benchmark::kMillisecond);
  }
  for (const int n : {7, 10}) {
    for (const int delay : {1, 20, 100}) {
      for (const auto& [name, speed] : {std::pair("design/loop", 0.5), {"design/hopeless", 2.0}}) {
        benchmark::RegisterBenchmark(name, sampled, speed)
            ->Args({n, delay})
            ->Unit(benchmark::kMillisecond);
      }
    }
  }
  for (const int delay : {0, 1}) {
    for (const bool proved : {false, true}) {
      benchmark::RegisterBenchmark(proved ? "contact/proved" : "contact/limit", contact, proved)
          ->Args({7, delay})
          ->Unit(benchmark::kMillisecond);
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
