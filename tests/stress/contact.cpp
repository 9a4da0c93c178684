// Limits of random loops in contact, against balls of 50 digits and a fine scan.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/proved_contact.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace {

using dashpot::analysis::ContactLimit;
using dashpot::analysis::ContactPoint;
using dashpot::testing::Dice;
using dashpot::testing::proved_stable;
using dashpot::testing::RandomTouch;

/// Counts of the brackets and verdicts of all loops with a delay, or without one.
struct Seen {
  int drawn = 0, brackets = 0, unproved = 0, verdicts = 0, unknown = 0, wrong = 0, missed = 0;
  double widest = 0;

  void judge(const RandomTouch& touched, double k, bool stable) {
    const std::optional<bool> proved = proved_stable(touched, k);
    ++verdicts;
    unknown += proved ? 0 : 1;
    wrong += proved && *proved != stable ? 1 : 0;
  }
  /// Looks for bands of instability below `end` in steps of 0.4 %. Whether there is one.
  void scan(const RandomTouch& touched, double end) {
    constexpr double kFirst = 1, kStep = 1.004, kEnd = 1 - 1e-4, kSeen = 1e-9;
    std::vector<double> stiffness;
    for (double k = kFirst; k < kEnd * end; k *= kStep) stiffness.push_back(k);
    bool band = false;
    for (const ContactPoint& point : dashpot::analysis::contact_curve(
             touched.system, dashpot::analysis::analyze(touched.system), touched.loop,
             touched.touch, stiffness)) {
      band = band || (point.damping_ratio < -kSeen &&
                      proved_stable(touched, point.stiffness) == std::optional<bool>(false));
    }
    missed += band ? 1 : 0;
  }
  void print(const char* loops) const {
    std::printf("| %s | %d | %d, %d | %.1e | %d, %d, %d | %d |\n", loops, drawn, brackets, unproved,
                widest, verdicts, wrong, unknown, missed);
  }
};

bool compare(const dashpot::stress::Request& request) {
  constexpr int kBelow = 4;
  std::printf(
      "seed %lu\n| loops | drawn | with a limit, one end not proved | widest bracket, of the limit "
      "| verdicts of 50 digits, wrong, not known | with a missed band "
      "|\n|---|---|---|---|---|---|\n",
      request.seed);
  Seen seen[2];
  for (std::uint64_t k = 0; seen[0].brackets + seen[1].brackets < request.whole(); ++k) {
    Dice random(1'000'003 * request.seed + k);
    const RandomTouch touched(random, true);
    Seen& all = seen[touched.loop.delay > 0 ? 1 : 0];
    const ContactLimit found = touched.limit();
    ++all.drawn;
    all.scan(touched, std::min(found.stiffness, touched.touch.most));
    if (!(found.stiffness > 0) || std::isinf(found.stiffness)) {
      all.judge(touched, 0, found.stiffness > 0);
      continue;
    }
    ++all.brackets;
    if (!(found.lower < found.stiffness && found.stiffness < found.upper)) {
      ++all.unproved;
      continue;
    }
    all.widest = std::max(all.widest, (found.upper - found.lower) / found.stiffness);
    all.judge(touched, found.lower, true);
    all.judge(touched, found.upper, false);
    for (int i = 0; i < kBelow; ++i) {
      all.judge(touched, found.lower * random.log_uniform(1e-3, 1), true);
    }
  }
  seen[0].print("without delay");
  seen[1].print("with delay");
  return seen[0].wrong + seen[1].wrong + seen[0].missed + seen[1].missed == 0;
}

const dashpot::stress::AddPart part(
    {"contact",
     10,
     "Compare the limits of random loops in contact with balls of 50 digits and a fine scan",
     "LIMITS",
     {{1000, 20}},
     compare,
     {"SEED"}});

}  // namespace
