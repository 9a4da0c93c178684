// Leaves out what a tick or a scene does not need, beside the same with all of it, and compares the
// numbers, of all arms. Spectra are compared with what Arb proves (certified_referee_test).
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/controller_skips.hpp>
#include <dashpot/tests/support/plant_skips.hpp>

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
  bool good = ticks(steps, request.seed);
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
