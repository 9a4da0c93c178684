// Follows the modes along random paths of every family of tests/support/tracker_paths.hpp, and
// checks every published bound against eigenvalues in long double; what comes near its bound, and
// every hundredth step besides, against 50 digits:
//     tracker_stress [STEPS [SEED]]
#include <dashpot/tests/support/enclosure.hpp>
#include <dashpot/tests/support/tracker_paths.hpp>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <boost/multiprecision/eigen.hpp>

#include <cstdio>
#include <cstdlib>
#include <memory>

namespace {

using namespace dashpot::analysis;  // NOLINT(google-build-using-namespace)
using dashpot::testing::Dice;
using dashpot::testing::judge;
using dashpot::testing::PathFamily;
using dashpot::testing::SystemPath;
using dashpot::testing::Verdict;

using Real50 = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<50>,
                                             boost::multiprecision::et_off>;

constexpr int kStepsOfAPath = 200;
constexpr long kApart = 100;  ///< of the checks with 50 digits

struct Tally {
  long steps = 0, precise = 0, unproved = 0, outside = 0;
  double tightest = 0;  ///< largest error / bound
  double widest = 0;    ///< largest relative bound
  TrackerCounters counters;
};

void add(const TrackerCounters& from, TrackerCounters& to) {
  to.tracked += from.tracked;
  to.reused += from.reused;
  to.direct += from.direct;
  to.failed += from.failed;
  to.iterations += from.iterations;
}

/// One path, made and followed with `seed`.
void follow(const PathFamily& family, std::uint64_t seed, int steps, Tally& tally) {
  Dice dice(seed);
  const SystemPath path = family.make(dice);
  const auto tracker = std::make_unique<ModeTracker>();
  const auto spectrum = std::make_unique<TrackedSpectrum>();
  for (int step = 0; step < steps; ++step) {
    const double t = static_cast<double>(step) / (kStepsOfAPath - 1);
    const System<kMaxDof> system = path(t);
    ++tally.steps;
    const Status status = tracker->update(system, *spectrum);
    if (status != Status::kOk && status != Status::kUncertified) continue;  // counted as failed
    Verdict verdict = judge<long double>(system, *spectrum, 0);
    if (!verdict.enclosed || verdict.tightest > 0.5 || tally.steps % kApart == 0) {
      verdict = judge<Real50>(system, *spectrum, 0);
      ++tally.precise;
    }
    if (verdict.proved) {
      tally.tightest = std::max(tally.tightest, verdict.tightest);
      tally.widest = std::max(tally.widest, verdict.widest);
    } else {
      ++tally.unproved;
      if (status == Status::kOk && verdict.enclosed) {
        verdict.enclosed = false;
        verdict.what = "a bound is missing without a word";
      }
    }
    if (verdict.enclosed) continue;
    if (tally.outside++ == 0) {
      std::printf("%s, seed %llu, step %d: outside its bound: %s (error / bound %.3g)\n",
                  family.name.c_str(), static_cast<unsigned long long>(seed), step, verdict.what,
                  verdict.tightest);
    }
  }
  add(tracker->counters(), tally.counters);
}

void print_head() {
  std::printf("%-17s %7s %6s %7s %6s %6s %6s | %5s | %8s %8s\n", "family", "steps", "digits",
              "tracked", "reused", "direct", "failed", "pass", "err/bnd", "widest");
}

void print(const std::string& name, const Tally& t) {
  const TrackerCounters& c = t.counters;
  std::printf("%-17s %7ld %6ld %7lld %6lld %6lld %6lld | %5.2f | %8.2g %8.1e", name.c_str(),
              t.steps, t.precise, static_cast<long long>(c.tracked),
              static_cast<long long>(c.reused), static_cast<long long>(c.direct),
              static_cast<long long>(c.failed),
              static_cast<double>(c.iterations) /
                  static_cast<double>(std::max<std::int64_t>(1, c.tracked + c.direct)),
              t.tightest, t.widest);
  if (t.unproved > 0) std::printf(", %ld steps without a bound", t.unproved);
  if (t.outside > 0) std::printf(", %ld OUTSIDE", t.outside);
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  const long steps = argc > 1 ? std::atol(argv[1]) : 100'000;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const auto& families = dashpot::testing::path_families();
  const long each =
      (steps + static_cast<long>(families.size()) - 1) / static_cast<long>(families.size());
  std::printf("Seed %llu. `digits`: steps judged with 50 digits; the rest in long double.\n",
              static_cast<unsigned long long>(seed));
  print_head();
  Tally all;
  for (const PathFamily& family : families) {
    Tally tally;
    for (std::uint64_t k = 0; tally.steps < each; ++k) {
      const long left = each - tally.steps;
      follow(family, 1'000'003 * seed + k, static_cast<int>(std::min<long>(left, kStepsOfAPath)),
             tally);
    }
    print(family.name, tally);
    all.steps += tally.steps;
    all.precise += tally.precise;
    all.unproved += tally.unproved;
    all.outside += tally.outside;
    all.tightest = std::max(all.tightest, tally.tightest);
    all.widest = std::max(all.widest, tally.widest);
    add(tally.counters, all.counters);
  }
  print("all", all);
  return all.outside == 0 && all.counters.failed == 0 ? 0 : 1;
}
