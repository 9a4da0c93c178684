// Follows the modes along random paths of every family of tests/support/tracker_paths.hpp, and
// checks every published bound against eigenvalues in long double; errors near their bound, and
// every hundredth step, also against eigenvalues that FLINT/Arb proves.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/enclosure.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/tracker_paths.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>

namespace {

using namespace dashpot::analysis;  // NOLINT(google-build-using-namespace)
using dashpot::testing::judge;
using dashpot::testing::judge_against;
using dashpot::testing::PathFamily;
using dashpot::testing::proved_eigenvalues;
using dashpot::testing::SystemPath;
using dashpot::testing::Verdict;

constexpr long kStepsOfAPath = 200;
constexpr long kApart = 100;  ///< of the checks by Arb

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

void add(const Tally& from, Tally& to) {
  to.steps += from.steps;
  to.precise += from.precise;
  to.unproved += from.unproved;
  to.outside += from.outside;
  to.tightest = std::max(to.tightest, from.tightest);
  to.widest = std::max(to.widest, from.widest);
  add(from.counters, to.counters);
}

/// One path, made with `seed`.
void follow(const PathFamily& family, const SystemPath& path, std::uint64_t seed, int steps,
            Tally& tally) {
  const auto tracker = std::make_unique<ModeTracker>();
  const auto spectrum = std::make_unique<TrackedSpectrum>();
  for (int step = 0; step < steps; ++step) {
    const double t = static_cast<double>(step) / (kStepsOfAPath - 1);
    const System<kMaxDof> system = path(t);
    ++tally.steps;
    const Status status = tracker->update(system, *spectrum);
    if (status != Status::kOk && status != Status::kUncertified) continue;  // counted as failed
    Verdict verdict = judge(system, *spectrum, 0);
    if (!verdict.enclosed || verdict.tightest > 0.5 || tally.steps % kApart == 0) {
      verdict = judge_against(proved_eigenvalues(system), *spectrum, 0);
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
      std::printf("%s, seed %lu, step %d: outside its bound: %s (error / bound %.3g)\n",
                  family.name.c_str(), seed, step, verdict.what, verdict.tightest);
    }
  }
  add(tracker->counters(), tally.counters);
}

void print(const std::string& name, const Tally& t) {
  const TrackerCounters& c = t.counters;
  std::printf("%-17s %7ld %6ld %7ld %6ld %6ld %6ld | %5.2f | %8.2g %8.1e", name.c_str(), t.steps,
              t.precise, c.tracked, c.reused, c.direct, c.failed,
              static_cast<double>(c.iterations) /
                  static_cast<double>(std::max<std::int64_t>(1, c.tracked + c.direct)),
              t.tightest, t.widest);
  if (t.unproved > 0) std::printf(", %ld steps without a bound", t.unproved);
  if (t.outside > 0) std::printf(", %ld OUTSIDE", t.outside);
  std::printf("\n");
}

bool follow_all(const dashpot::stress::Request& request) {
  const auto families = static_cast<long>(dashpot::testing::path_families().size());
  const long each = (request.whole() + families - 1) / families;
  std::printf("Seed %lu. `digits`: steps judged by FLINT/Arb; the rest in long double.\n",
              request.seed);
  std::printf("%-17s %7s %6s %7s %6s %6s %6s | %5s | %8s %8s\n", "family", "steps", "digits",
              "tracked", "reused", "direct", "failed", "pass", "err/bnd", "widest");
  Tally all;
  for (const PathFamily& family : dashpot::testing::path_families()) {
    Tally tally;
    std::uint64_t seed = 1'000'003 * request.seed;
    for (long left = each; left > 0; left -= kStepsOfAPath, ++seed) {
      dashpot::testing::Dice dice(seed);
      follow(family, family.make(dice), seed, static_cast<int>(std::min(left, kStepsOfAPath)),
             tally);
    }
    print(family.name, tally);
    add(tally, all);
  }
  print("all", all);
  return all.outside == 0 && all.counters.failed == 0;
}

const dashpot::stress::AddPart part({"tracker",
                                     2,
                                     "Follow modes along random paths, each bound checked",
                                     "STEPS",
                                     {{100'000, 2400}},
                                     follow_all,
                                     {"SEED"}});

}  // namespace
