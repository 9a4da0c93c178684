// Leaves out what a system, a tick or a scene does not need, beside the same with all of it, and
// compares the numbers, over all families of tests/support/tracker_paths.hpp and all arms:
//     skip_stress [STEPS [SEED]]
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/controller_skips.hpp>
#include <dashpot/tests/support/plant_skips.hpp>
#include <dashpot/tests/support/spectrum_skips.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace {

using namespace dashpot::testing;  // NOLINT(google-build-using-namespace)

/// Whether it is good.
bool print(const SkipTally& tally) {
  const char* const verdict = tally.good() ? "" : tally.outside > 0 ? "DIFFERS" : "NEVER LEFT OUT";
  std::printf("  %-44s %9lld %10lld  %8.2g  %s\n", tally.what.c_str(),
              static_cast<long long>(tally.left_out), static_cast<long long>(tally.compared),
              tally.largest, verdict);
  return tally.good();
}

bool spectra(long steps, std::uint64_t seed) {
  constexpr int kStepsOfAPath = 200, kApart = 10;  // of the systems that are solved
  const auto& families = path_families();
  const long each = steps / static_cast<long>(families.size());
  TrackerSkips tracked;
  SolverSkips solved;
  bool good = true;
  for (const PathFamily& family : families) {
    for (long step = 0; step < each;) {
      const std::uint64_t path_seed = 1'000'003 * seed + static_cast<std::uint64_t>(step);
      Dice dice(path_seed);
      const SystemPath path = family.make(dice);
      tracked.start();
      for (int k = 0; k < kStepsOfAPath && step < each; ++k, ++step) {
        const TrackedSystem system = path(static_cast<double>(k) / (kStepsOfAPath - 1));
        tracked.step(system);
        if (k % kApart == 0) solved.see(system);
      }
      bool now = true;
      for (const SkipTally* tally : tracked.tallies()) now &= tally->outside == 0;
      for (const SkipTally* tally : solved.tallies()) now &= tally->outside == 0;
      if (good && !now) {
        std::printf("  the first that differs: %s, seed %llu\n", family.name.c_str(),
                    static_cast<unsigned long long>(path_seed));
      }
      good &= now;
    }
  }
  for (const SkipTally* tally : tracked.tallies()) good &= print(*tally);
  for (const SkipTally* tally : solved.tallies()) good &= print(*tally);
  return good;
}

bool ticks(long steps, std::uint64_t seed) {
  std::vector<TermSkip> terms = term_skips();
  std::vector<SkipTally> analyses(5);
  for (const Arm& arm : arms()) {
    const auto model = arm_model(arm);
    AnalysisSkips skips(model, seed, true);
    for (long k = 0; k < steps / 4; ++k) skips.tick();
    std::size_t i = 0;
    for (const SkipTally* tally : skips.tallies()) analyses[i++] += *tally;
    for (TermSkip& skip : terms)
      run_skip(model, static_cast<int>(std::max(1000L, steps / 20)), skip);
  }
  bool good = true;
  for (const SkipTally& tally : analyses) good &= print(tally);
  for (const TermSkip& skip : terms) good &= print(skip.tally);
  return good;
}

bool simulations(long rounds, std::uint64_t seed) {
  std::vector<PlantSkip> scenes = plant_skips();
  SkipTally contact{"rates kept from the step before"};
  for (long k = 0; k < rounds; ++k) {
    const std::uint64_t round_seed = seed + static_cast<std::uint64_t>(k);
    for (PlantSkip& skip : scenes) run_skip(round_seed, skip);
    run_contact_skip(round_seed, contact);
  }
  bool good = print(contact);
  for (const PlantSkip& skip : scenes) good &= print(skip.tally);
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  const long steps = argc > 1 ? std::atol(argv[1]) : 100'000;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  std::printf(
      "Seed %llu. Largest difference in units of what is allowed: of modes the sum of both\n"
      "proved bounds, of torques and motions rounding errors, or nothing at all.\n"
      "  %-44s %9s %10s  %8s\n",
      static_cast<unsigned long long>(seed), "left out", "times", "numbers", "largest");
  bool good = spectra(steps, seed);
  good &= ticks(steps, seed);
  good &= simulations(std::max(1L, steps / 10'000), seed);
  return good ? 0 : 1;
}
