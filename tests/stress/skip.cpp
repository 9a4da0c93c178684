// Leaves out what a system, a tick or a scene does not need, beside the same with all of it, and
// compares the numbers, over all families of tests/support/tracker_paths.hpp and all arms.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/stress/paths.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/controller_skips.hpp>
#include <dashpot/tests/support/plant_skips.hpp>
#include <dashpot/tests/support/spectrum_skips.hpp>

#include <algorithm>
#include <cstdio>

namespace {

using namespace dashpot::stress;   // NOLINT(google-build-using-namespace)
using namespace dashpot::testing;  // NOLINT(google-build-using-namespace)

/// Whether it is good.
bool print(const SkipTally& tally) {
  const char* const verdict = tally.good() ? "" : tally.outside > 0 ? "DIFFERS" : "NEVER LEFT OUT";
  std::printf("  %-44s %9ld %10ld  %8.2g  %s\n", tally.what.c_str(), tally.left_out, tally.compared,
              tally.largest, verdict);
  return tally.good();
}

bool spectra(long steps, std::uint64_t seed) {
  constexpr int kApart = 10;  // of the systems that are solved
  TrackerSkips tracked;
  SolverSkips solved;
  std::vector<const SkipTally*> tallies;
  bool good = true;
  for (const PathFamily& family : path_families()) {
    follow_paths(family, seed, steps_of_each(steps),
                 [&](const SystemPath& path, std::uint64_t path_seed, int length) {
                   tracked.start();
                   for (int k = 0; k < length; ++k) {
                     const auto system = path(static_cast<double>(k) / (kStepsOfAPath - 1));
                     tracked.step(system);
                     if (k % kApart == 0) solved.see(system);
                   }
                   tallies.clear();
                   for (const SkipTally* tally : tracked.tallies()) tallies.push_back(tally);
                   for (const SkipTally* tally : solved.tallies()) tallies.push_back(tally);
                   const bool now = std::all_of(tallies.begin(), tallies.end(),
                                                [](auto* tally) { return tally->outside == 0; });
                   if (good && !now) {
                     std::printf("  the first that differs: %s, seed %lu\n", family.name.c_str(),
                                 path_seed);
                   }
                   good &= now;
                 });
  }
  for (const SkipTally* tally : tallies) good &= print(*tally);
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

bool compare_all(const Request& request) {
  const long steps = request.whole();
  std::printf(
      "Seed %lu. Largest difference in units of what is allowed: of modes the sum of both\n"
      "proved bounds, of torques and motions rounding errors, or nothing at all.\n"
      "  %-44s %9s %10s  %8s\n",
      request.seed, "left out", "times", "numbers", "largest");
  bool good = spectra(steps, request.seed);
  good &= ticks(steps, request.seed);
  good &= simulations(std::max(1L, steps / 10'000), request.seed);
  return good;
}

const AddPart part({"skip",
                    5,
                    "Compare what was left out as not needed with what comes of computing it",
                    "STEPS",
                    {{100'000, 2400}},
                    compare_all,
                    {"SEED"}});

}  // namespace
