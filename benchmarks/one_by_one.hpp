#pragma once
// Calls that are timed one by one, because what happens between them matters.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

namespace dashpot::benchmarks {

/// Sleeps until the next millisecond, as a control loop does. Meanwhile the machine does other
/// things, and the processor saves power.
class Paced {
 public:
  void operator()() {
    next_ += std::chrono::milliseconds(1);
    const auto now = std::chrono::steady_clock::now();
    if (next_ < now) next_ = now;
    std::this_thread::sleep_until(next_);
  }

 private:
  std::chrono::steady_clock::time_point next_ = std::chrono::steady_clock::now();
};

/// Passes 64 MB of other data through the caches.
class Evicted {
 public:
  void operator()() {
    constexpr std::size_t kLine = 64 / sizeof(std::uint64_t);
    for (std::size_t i = 0; i < data_.size(); i += kLine) sum_ += ++data_[i];
    benchmark::DoNotOptimize(sum_);
  }

 private:
  std::vector<std::uint64_t> data_ =
      std::vector<std::uint64_t>((std::size_t{64} << 20) / sizeof(std::uint64_t));
  std::uint64_t sum_ = 0;
};

/// Clock times of the calls, each after `prepare`, as percentiles in us. They include other work of
/// the machine. The benchmark needs UseManualTime and Iterations.
template <class Prepare, class Call>
void time_one_by_one(benchmark::State& bench, Prepare prepare, const Call& call) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> times;
  times.reserve(static_cast<std::size_t>(bench.max_iterations));
  for (auto _ : bench) {
    prepare();
    const Clock::time_point start = Clock::now();
    call();
    const std::chrono::duration<double> taken = Clock::now() - start;
    times.push_back(1e6 * taken.count());
    bench.SetIterationTime(taken.count());
  }
  std::sort(times.begin(), times.end());
  const auto at = [&](double share) {
    return times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
  };
  bench.counters["median_us"] = at(0.5);
  bench.counters["p99_us"] = at(0.99);
  bench.counters["p99.9_us"] = at(0.999);
  bench.counters["max_us"] = at(1);
}

}  // namespace dashpot::benchmarks
