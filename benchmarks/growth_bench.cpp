// Growth of a damping design for a region with the number of configurations
// (growth/configurations/N, one thread; growth/region/N, all threads, once) and its speed-up with
// the number of threads (growth/threads/T, 32 configurations). The other programs show the growth
// with joints and modes.
#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/tests/support/panda_path.hpp>

#include <benchmark/benchmark.h>

#include <vector>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)

void design(benchmark::State& state, int configurations, int threads) {
  std::vector<analysis::TaskImpedance> region;
  for (int i = 0; i < configurations; ++i) {
    const testing::ArmModel arm = testing::panda(testing::swing(3.2 * i / configurations));
    analysis::TaskImpedance impedance;
    impedance.mass = arm.mass;
    impedance.jacobian = arm.jacobian;
    const Eigen::VectorXd K_C = (Eigen::VectorXd(6) << 2000, 600, 2000, 100, 100, 100).finished();
    impedance.task_stiffness = Eigen::MatrixXd(K_C.asDiagonal());
    region.push_back(impedance);
  }
  analysis::RegionOptions options;
  options.target = analysis::DampingTarget::constant(0.7);
  options.threads = threads;
  double level = 0;
  for (auto _ : state) level = analysis::design_region(region, options).level;
  state.counters["level"] = level;
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (const int configurations : {2, 4, 8, 16, 32}) {
    benchmark::RegisterBenchmark(
        ("growth/configurations/" + std::to_string(configurations)).c_str(),
        [=](benchmark::State& s) { design(s, configurations, 1); })
        ->Unit(benchmark::kMillisecond);
  }
  for (const int configurations : {1000, 10000}) {
    benchmark::RegisterBenchmark(("growth/region/" + std::to_string(configurations)).c_str(),
                                 [=](benchmark::State& s) { design(s, configurations, 0); })
        ->Unit(benchmark::kSecond)
        ->UseRealTime()
        ->Iterations(1);
  }
  for (const int threads : {1, 2, 4}) {
    benchmark::RegisterBenchmark(("growth/threads/" + std::to_string(threads)).c_str(),
                                 [=](benchmark::State& s) { design(s, 32, threads); })
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime();
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
