// Leads each arm of sim/models through its workspace, through its stretched singularity and back,
// at 1 kHz, with its modes followed as in the controller's tick, and watches them.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/arm_path.hpp>
#include <dashpot/tests/support/enclosure.hpp>

#include <cstdio>

namespace {

using namespace dashpot::stress;   // NOLINT(google-build-using-namespace)
using namespace dashpot::testing;  // NOLINT(google-build-using-namespace)
using dashpot::analysis::TrackerCounters;

void print(const char* arm, const GainScales& scales, const TrackerCounters& c, const ModeWatch& w,
           const Verdict& all) {
  std::printf("%-12s %4g %4g | %6ld %6ld %5ld | %4.2f | %4.2f %7.1e | %7ld %4ld | %7.1e\n", arm,
              scales.damping, scales.null_space, c.updates(), c.tracked, c.direct,
              static_cast<double>(c.iterations) / static_cast<double>(c.updates()), all.tightest,
              all.widest, w.separated, w.lost, w.largest_change);
}

bool lead(const Arm& arm, const GainScales& scales, long ticks) {
  const auto watched = std::make_unique<WatchedArm>(arm_model(arm), scales, arm.file);
  Verdict all;
  for (long tick = 0; tick <= ticks; ++tick) {
    watched->step(static_cast<double>(tick) / static_cast<double>(ticks));
    if (tick % 20 != 0) continue;
    const Verdict verdict = judge(watched->system(), watched->spectrum(), 0);
    all.enclosed = all.enclosed && verdict.enclosed;
    all.tightest = std::max(all.tightest, verdict.tightest);
    all.widest = std::max(all.widest, verdict.widest);
  }
  const ModeWatch& w = watched->watch();
  print(arm.file, scales, watched->counters(), w, all);
  const bool good = all.enclosed && w.lost == 0 && w.not_numbers == 0 && w.bounds_missing == 0 &&
                    watched->counters().failed == 0;
  if (!good) {
    std::printf("  NOT GOOD: enclosed %d, not a number %ld, without bound %ld\n", all.enclosed,
                w.not_numbers, w.bounds_missing);
  }
  return good;
}

bool lead_arms(const Request& request) {
  std::printf(
      "Damping and null space: multiples of the default gains. Modes: identity decided by the "
      "eigenvalues,\nlost; largest change of such a mode's damping ratio from tick to tick.\n"
      "arm          damp null |  ticks track. dir.  | pass | err/ "
      "widest  |"
      "  apart  lost | change\n");
  bool good = true;
  for (const Arm& arm : arms()) {
    for (const GainScales& scales : {GainScales{1, 1}, GainScales{0.1, 0}, GainScales{3, 1}}) {
      good &= lead(arm, scales, std::lround(1000 * request.count));
    }
  }
  return good;
}

const AddPart part({"arm",
                    3,
                    "Lead each arm through its workspace and its stretched singularity at 1 kHz, "
                    "with its modes followed",
                    "SECONDS",
                    {{20, 2}},
                    lead_arms});

}  // namespace
