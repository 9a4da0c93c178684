#include <dashpot/identification/model/realization.hpp>
#include <dashpot/identification/search/doubts.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace dashpot::identification {
namespace {

// Limits of the residual:
constexpr double kNotWhite = 2;   ///< whiteness: beyond it the residual is more than sensor noise
constexpr double kMuch = 0.1;     ///< of the motion: more than the noise of inputs leaves over
constexpr double kPoor = 0.01;    ///< of the motion: modes of one order may make up for as much
constexpr double kLittle = 1e-3;  ///< of the motion: a model that several records share is right
constexpr double kOfRest = 0.3;   ///< energy, of the rest: so weak a mode may be a piece of it
constexpr double kLightly = 0.1;  ///< damping ratio: friction does not make such a mode by itself
constexpr double kBeside = 0.1;   ///< energy, of the strongest lightly damped: friction makes less
// Limits of the records:
constexpr double kFewestParts = 0.8;    ///< share that has a mode: fewer give no spread of it
constexpr double kLeastRatio = 0.001;   ///< damping ratio: driven motion has less
constexpr double kUndetermined = 0.05;  ///< relative deviation: beyond it the mode may be any
constexpr double kUndeterminedInDecays = 0.06;  ///< more: one decay's is widened
constexpr double kTurn = 2.5;     ///< rad from sample to sample: beyond pi it would be another one
constexpr double kSeenTurn = 3;   ///< rad: about half a turn has to be in the record,
constexpr double kSeenDecay = 1;  ///< or a decay to 1 / e
// Limits of energy, as a share of the motion:
constexpr double kMostEnergy = 100;    ///< more is the difference of modes that cancel
constexpr double kLeastEnergy = 1e-6;  ///< a thousandth of the size: no arm is so linear
/// Other orders miss heavily damped modes, but no true lightly damped one.
constexpr double kAloneWeak = 1e-3, kLightlyAloneWeak = 3e-3;
constexpr double kCounts = 1e-3;  ///< a weaker rejected mode does not discredit a model
// Limits of modes beside each other:
constexpr double kLikeShapes = 0.8;  ///< modal assurance criterion: shapes of one motion
constexpr double kNextTo = 0.05;     ///< relative distance: a frequency changes so with its size
constexpr double kLarger = 2;        ///< energy: of two alike the weaker one is the change
constexpr double kTwice = 0.2, kTwiceDeviations = 4;  ///< distance of one mode found twice
constexpr double kSure = 2;            ///< deviations: beyond it a difference is not by chance
constexpr double kHarmonic = 3;        ///< of odd forces, such as friction; sums show even ones
constexpr double kExplains = 5;        ///< energy, over a mode's: a nonlinearity is weaker
constexpr double kCoincides = 0.002;   ///< relative: a nonlinearity moves larger modes, too
constexpr double kHasHarmonics = 0.3;  ///< damping ratio: a fast decay has none
constexpr double kWhite = 1.5;         ///< whiteness: below it the residual is noise

bool not_white(const Evidence& e) {
  return e.records.whiteness > kNotWhite;
}

/// Whether a mode may imitate friction, which adds modes near a true one, heavily damped ones, and
/// weak ones. The residual of driven motion contains the noise of inputs, too. Rounding is not
/// white either, but of a known size. Several records that agree with hardly any residual confirm
/// the mode.
bool may_be_friction(const Evidence& e) {
  double most = 0;
  for (const MeasuredMode& mode : e.all) {
    if (mode.damping_ratio < kLightly) most = std::max(most, mode.energy);
  }
  const RecordFacts& r = e.records;
  const bool agreed =
      r.records > 1 && !r.differs && e.mode.stability > 0 && r.unexplained < kLittle;
  return not_white(e) && !r.rounded && (r.kind == MotionKind::kDecays || r.unexplained > kMuch) &&
         !agreed && (e.mode.damping_ratio > kLightly || e.mode.energy < kBeside * most);
}

double undetermined(const Evidence& e) {
  return e.records.kind == MotionKind::kDecays ? kUndeterminedInDecays : kUndetermined;
}

/// Whether there is another mode for which `like` is true.
template <typename Like>
bool beside(const Evidence& e, const Like& like) {
  return std::any_of(e.all.begin(), e.all.end(),
                     [&](const MeasuredMode& other) { return &other != &e.mode && like(other); });
}

double distance(const MeasuredMode& a, const MeasuredMode& b) {
  return std::abs(a.eigenvalues[0] - b.eigenvalues[0]);
}

/// Whether a mode may be a nonlinearity of this other one, which is known itself.
bool explains(const MeasuredMode& other, const MeasuredMode& mode) {
  return other.energy > kExplains * mode.energy && other.energy < kMostEnergy;
}

bool coincides(const MeasuredMode& mode, double distance, double size) {
  return distance < std::max(kCoincides * size, kSure * mode.natural_frequency_std);
}

bool is_sum(const MeasuredMode& mode, const MeasuredMode& a, const MeasuredMode& b) {
  const Complex& lambda = mode.eigenvalues[0];
  return std::any_of(b.eigenvalues.begin(), b.eigenvalues.end(), [&](const Complex& other) {
    return coincides(mode, std::abs(a.eigenvalues[0] + other - lambda), std::abs(lambda));
  });
}

/// Counts of the modes that are believed so far.
struct Believed {
  std::size_t believed = 0, stable = 0, rejected = 0;
  bool whole = true;  ///< nothing that counts is rejected

  explicit Believed(std::span<const MeasuredMode> all) {
    for (const MeasuredMode& mode : all) {
      const bool is_believed = mode.reason.empty();
      ++(is_believed ? believed : rejected);
      stable += is_believed && mode.stability > 0;
      whole = whole && (is_believed || !(mode.energy > kCounts));
    }
  }
};

bool always(const Evidence& /*evidence*/) {
  return true;
}

constexpr auto kRules = std::to_array<Rule>({
    {Stage::kHum, "hum", "a steady hum, which was removed", always},
    {Stage::kNotRepeated, "not repeated", "parts of the records lack it: a nonlinearity or noise",
     always},

    {Stage::kParts, "few parts", "not there without some parts of the record",
     [](const Evidence& e) { return e.parts < kFewestParts; }},
    {Stage::kParts, "driven", "it does not decay: something moves at this frequency",
     [](const Evidence& e) {
       return e.mode.damping_ratio + kSure * e.mode.damping_ratio_std < kLeastRatio;
     }},

    {Stage::kLeftOver, "friction, parts differ",
     "parts of the records differ: it may be friction or another nonlinearity",
     [](const Evidence& e) { return e.records.differs && may_be_friction(e); }, true},
    {Stage::kLeftOver, "friction, much left",
     "the residual is large: it may be friction or another nonlinearity",
     [](const Evidence& e) { return e.records.unexplained > kMuch && may_be_friction(e); }, true},
    {Stage::kLeftOver, "friction",
     "the residual is not noise: it may be friction or another nonlinearity", may_be_friction,
     true},
    {Stage::kLeftOver, "weaker than rest", "much weaker than the residual",
     [](const Evidence& e) {
       return e.mode.stability > 0 && e.records.kind == MotionKind::kDecays &&
              e.mode.energy < kOfRest * e.records.unexplained;
     }},
    {Stage::kLeftOver, "alone, weaker than rest",
     "weaker than the residual, and in no model of another order",
     [](const Evidence& e) {
       return e.mode.stability == 0 && e.mode.energy < e.records.unexplained;
     }},
    {Stage::kLeftOver, "alone, rounded",
     "in no model of another order, and the residual consists of the sensors' steps",
     [](const Evidence& e) { return e.mode.stability == 0 && e.records.rounded && not_white(e); }},
    {Stage::kLeftOver, "alone, much left",
     "in no model of another order, and the residual is large",
     [](const Evidence& e) {
       return e.mode.stability == 0 && !e.records.rounded && e.records.unexplained > kPoor;
     },
     true},

    {Stage::kMode, "single", "a decay without oscillation, whose partner the records do not show",
     [](const Evidence& e) {
       const auto& lambda = e.mode.eigenvalues;
       return lambda[0] == lambda[1] && lambda[0].imag() == 0;
     }},
    {Stage::kMode, "cancels", "it cancels against others like it: neither is determined",
     [](const Evidence& e) { return e.mode.energy > kMostEnergy; }},
    {Stage::kMode, "frequency", "its frequency is not determined",
     [](const Evidence& e) {
       return !(e.mode.natural_frequency_std < undetermined(e) * e.mode.natural_frequency);
     }},
    {Stage::kMode, "ratio", "its damping ratio is not determined",
     [](const Evidence& e) {
       return !(e.mode.damping_ratio_std < undetermined(e) * std::max(1.0, e.mode.damping_ratio));
     }},
    {Stage::kMode, "too fast", "too fast for the samples",
     [](const Evidence& e) { return e.mode.natural_frequency * e.records.step > kTurn; }},
    {Stage::kMode, "too slow", "too slow for the record",
     [](const Evidence& e) {
       const Complex& lambda = e.mode.eigenvalues[0];
       return lambda.imag() * e.records.duration < kSeenTurn && lambda.imag() != 0 &&
              -lambda.real() * e.records.duration < kSeenDecay;
     }},
    {Stage::kMode, "alone, weak", "weak, and in no model of another order",
     [](const Evidence& e) {
       return e.mode.stability == 0 &&
              e.mode.energy < (e.mode.damping_ratio < kLightly ? kLightlyAloneWeak : kAloneWeak);
     }},
    {Stage::kMode, "too weak", "too weak to distinguish from a nonlinearity",
     [](const Evidence& e) { return e.mode.energy < kLeastEnergy; }},
    {Stage::kMode, "change of a larger",
     "like a larger mode next to it: its frequency changes with its size",
     [](const Evidence& e) {
       return beside(e, [&](const MeasuredMode& other) {
         return other.energy > kLarger * e.mode.energy &&
                likeness(other.shape, e.mode.shape) > kLikeShapes &&
                distance(other, e.mode) < kNextTo * std::abs(e.mode.eigenvalues[0]);
       });
     }},
    {Stage::kMode, "same as a larger", "the same as a larger mode next to it",
     [](const Evidence& e) {
       return beside(e, [&](const MeasuredMode& other) {
         const double deviation =
             std::hypot(e.mode.natural_frequency_std, other.natural_frequency_std);
         return !(other.energy < e.mode.energy) && other.reason.empty() &&
                std::abs(other.natural_frequency - e.mode.natural_frequency) <
                    kTwiceDeviations * deviation &&
                distance(other, e.mode) < kTwice * std::abs(e.mode.eigenvalues[0]) &&
                likeness(other.shape, e.mode.shape) > kLikeShapes;
       });
     }},
    {Stage::kMode, "grows", "it grows",
     [](const Evidence& e) { return e.mode.damping_ratio + kSure * e.mode.damping_ratio_std < 0; }},
    {Stage::kMode, "no decay", "it does not decay within its deviation",
     [](const Evidence& e) {
       const bool free = e.records.kind == MotionKind::kDecays;
       return e.mode.damping_ratio <= (free ? e.mode.damping_ratio_std : 0);
     }},
    {Stage::kMode, "harmonic",
     "three times the frequency of a larger mode: a nonlinearity, not a mode",
     [](const Evidence& e) {
       return beside(e, [&](const MeasuredMode& other) {
         const double multiple = kHarmonic * other.eigenvalues[0].imag();
         return explains(other, e.mode) && multiple > 0 && e.mode.damping_ratio < kHasHarmonics &&
                coincides(e.mode, std::abs(e.mode.eigenvalues[0].imag() - multiple), multiple);
       });
     }},
    {Stage::kMode, "sum", "the sum of two eigenvalues of larger modes: a nonlinearity, not a mode",
     [](const Evidence& e) {
       return beside(e, [&](const MeasuredMode& a) {
         return explains(a, e.mode) && beside(e, [&](const MeasuredMode& b) {
                  return explains(b, e.mode) && is_sum(e.mode, a, b);
                });
       });
     }},

    // A model of a nonlinear decay explains it to its noise, with modes that no model of another
    // order has. The model of a linear decay has fewer such modes than others, or all of it is
    // believed. In driven and ambient motion the excitation colours the residual.
    {Stage::kTogether, "alone, as half",
     "in no model of another order, like half of this model's modes or more",
     [](const Evidence& e) {
       const Believed now(e.all);
       return e.mode.stability == 0 && e.records.kind == MotionKind::kDecays && !now.whole &&
              2 * now.stable <= now.believed;
     },
     true},
    {Stage::kTogether, "alone, as most",
     "in no model of another order, and most modes of this one are not believed",
     [](const Evidence& e) {
       const Believed now(e.all);
       return e.mode.stability == 0 && e.records.kind != MotionKind::kDecays &&
              e.records.whiteness > kWhite && now.rejected > now.believed;
     }},
});

}  // namespace

std::span<const Rule> doubts() {
  return kRules;
}

void weigh(Stage stage, const Evidence& evidence, MeasuredMode& mode) {
  const auto* const rule = std::find_if(kRules.begin(), kRules.end(), [&](const Rule& one) {
    return one.stage == stage && one.holds(evidence);
  });
  if (rule == kRules.end()) return;
  mode.reason = rule->words;
  mode.not_linear = rule->not_linear;
}

}  // namespace dashpot::identification
