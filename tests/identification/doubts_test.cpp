// Each rule by which a mode is not believed decides on either side of its limits, by itself.
#include <dashpot/identification/search/measured_modes.hpp>
#include <dashpot/tests/identification/good_mode.hpp>
#include <dashpot/tests/support/places.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <limits>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace dashpot::identification {
namespace {

using ::testing::Contains;
using ::testing::ElementsAreArray;
using ::testing::IsEmpty;
using ::testing::Not;

/// The evidence on the first of some modes.
struct Scene {
  std::vector<MeasuredMode> modes = {good_mode()};
  RecordFacts records = {.duration = 10, .step = 1e-3, .kind = MotionKind::kDecays};
  double parts = 1;

  MeasuredMode& first() { return modes.front(); }
  MeasuredMode& add(const MeasuredMode& other) { return modes.emplace_back(other); }
  Evidence evidence() const { return {modes.front(), modes, records, parts}; }
};

/// The names of the rules of a stage that hold.
std::vector<std::string> holding(Stage stage, const Scene& scene) {
  std::vector<std::string> names;
  for (const Rule& rule : doubts()) {
    if (rule.stage == stage && rule.holds(scene.evidence())) names.emplace_back(rule.name);
  }
  return names;
}

/// A number on whose limit a rule begins to hold, from `inside` to `outside`.
struct Limit {
  const char* rule;
  double inside, outside;
  std::function<void(Scene&, double)> set;
  std::vector<std::string> weaker = {};  ///< rules that come later and hold, too
};

void alone(Scene& s) {
  s.first().stability = 0;
}

/// A heavily damped mode of a decay of which more than noise is left over.
void rubs(Scene& s) {
  s.first() = good_mode(10, 0.2);
  s.records.whiteness = 3;
}

const std::vector<Limit>& limits() {
  static const std::vector<Limit> all = {
      {"few parts", 0.8, 0.79, [](Scene& s, double x) { s.parts = x; }},
      {"driven", 1.01e-3, 0.99e-3, [](Scene& s, double x) { s.first().damping_ratio = x - 0.02; }},

      {"friction, parts differ",
       0,
       1,
       [](Scene& s, double x) {
         rubs(s);
         s.records.records = 2;  // that agree have the mode
         s.records.differs = x > 0;
       },
       {"friction"}},
      {"friction, much left",
       1.99,
       2.01,
       [](Scene& s, double x) {
         rubs(s);
         s.records.kind = MotionKind::kDriven;
         s.records.whiteness = x;
         s.records.unexplained = 0.101;
       },
       {"friction"}},
      {"friction, much left",
       0.099,
       0.101,
       [](Scene& s, double x) {
         rubs(s);
         s.records.kind = MotionKind::kDriven;
         s.records.unexplained = x;
       },
       {"friction"}},
      {"friction", 1.99, 2.01, [](Scene& s, double x) { rubs(s), s.records.whiteness = x; }},
      {"friction", 0.099, 0.101, [](Scene& s, double x) { rubs(s), s.first().damping_ratio = x; }},
      {"friction", 0.051, 0.049,
       [](Scene& s, double x) {
         rubs(s);
         s.first() = s.add(good_mode(23, 0.05));
         s.first().energy = x;
       }},
      {"friction", 0.99e-3, 1.01e-3,
       [](Scene& s, double x) {
         rubs(s);
         s.records.records = 2;
         s.records.unexplained = x;
       }},
      {"friction", 1, 0, [](Scene& s, double x) { rubs(s), s.records.rounded = x > 0; }},
      {"weaker than rest", 0.31, 0.29,
       [](Scene& s, double x) { s.records.unexplained = 0.1, s.first().energy = 0.1 * x; }},
      {"alone, weaker than rest", 0.0091, 0.0089,
       [](Scene& s, double x) { alone(s), s.records.unexplained = 0.009, s.first().energy = x; }},
      {"alone, rounded", 1.99, 2.01,
       [](Scene& s, double x) { alone(s), s.records.rounded = true, s.records.whiteness = x; }},
      {"alone, much left", 0.0099, 0.0101,
       [](Scene& s, double x) { alone(s), s.records.unexplained = x; }},

      {"single", 1e-9, 0,
       [](Scene& s, double x) {
         s.first().eigenvalues = {Complex(-10, x), Complex(-10, -x)};
       }},
      {"cancels", 99, 101, [](Scene& s, double x) { s.first().energy = x; }},
      {"frequency", 0.59, 0.61, [](Scene& s, double x) { s.first().natural_frequency_std = x; }},
      {"frequency", 0.49, 0.51,
       [](Scene& s, double x) {
         s.records.kind = MotionKind::kDriven;
         s.first().natural_frequency_std = x;
       }},
      {"ratio", 0.059, 0.061, [](Scene& s, double x) { s.first().damping_ratio_std = x; }},
      {"ratio", 0.049, 0.051,
       [](Scene& s, double x) {
         s.records.kind = MotionKind::kAmbient;
         s.first().damping_ratio_std = x;
       }},
      {"too fast", 2490, 2510, [](Scene& s, double w) { s.first() = good_mode(w); }},
      {"too slow", 0.31, 0.30, [](Scene& s, double t) { s.records.duration = t; }},
      {"too slow", 0.201, 0.199,
       [](Scene& s, double t) { s.first() = good_mode(10, 0.5), s.records.duration = t; }},
      {"alone, weak", 1.01e-3, 0.99e-3, [](Scene& s, double x) { alone(s), s.first().energy = x; }},
      {"alone, weak", 3.1e-3, 2.9e-3,
       [](Scene& s, double x) {
         s.first() = good_mode(10, 0.05);
         alone(s), s.first().energy = x;
       }},
      {"too weak", 1.01e-6, 0.99e-6, [](Scene& s, double x) { s.first().energy = x; }},
      {"change of a larger", 10.51, 10.49,
       [](Scene& s, double w) {
         s.first().natural_frequency_std = 0.01;
         s.add(good_mode(w)).energy = 1.1;
         s.modes.back().natural_frequency_std = 0.01;
       }},
      {"change of a larger", 0.99, 1.01,
       [](Scene& s, double x) {
         s.first().natural_frequency_std = 0.01;
         s.add(good_mode(10.4)).energy = x;
         s.modes.back().natural_frequency_std = 0.01;
       }},
      {"change of a larger", 0.51, 0.49,
       [](Scene& s, double y) {
         s.first().natural_frequency_std = 0.01;
         s.add(good_mode(10.4)).energy = 1.1;
         s.modes.back().natural_frequency_std = 0.01;
         s.modes.back().shape = shape_of(1, y);
       }},
      {"same as a larger", 12.01, 11.99,
       [](Scene& s, double w) {
         s.first().natural_frequency_std = 0.59;
         s.add(good_mode(w)).energy = 0.9;
       }},
      {"same as a larger", 10.41, 10.39,
       [](Scene& s, double w) {
         s.first().natural_frequency_std = 0;
         s.add(good_mode(w)).energy = 0.9;
         s.modes.back().natural_frequency_std = 0.1;
       }},
      {"grows",
       -0.019,
       -0.021,
       [](Scene& s, double x) { s.first().damping_ratio = x; },
       {"no decay"}},
      {"no decay", 0.011, 0.009, [](Scene& s, double x) { s.first().damping_ratio = x; }},
      {"harmonic", 3.01, 3.005,
       [](Scene& s, double times) {
         const MeasuredMode larger = good_mode(10, 0.05);
         s.first() = good_mode(times * larger.eigenvalues[0].imag() / std::sqrt(1 - 0.01), 0.1);
         s.first().natural_frequency_std = 1e-3;
         s.first().shape = shape_of(0, 1);
         s.first().energy = 0.04;
         s.add(larger);
       }},
      {"sum", 1.00203, 1.00197,
       [](Scene& s, double times) {
         s.add(good_mode(23, 0.05)).shape = shape_of(0, 1);
         s.add(good_mode(40, 0.1)).shape = shape_of(1, 1);
         const Complex sum = s.modes[1].eigenvalues[0] + s.modes[2].eigenvalues[0];
         s.first() = good_mode(times * std::abs(sum), -sum.real() / std::abs(sum));
         s.first().natural_frequency_std = 1e-3;
         s.first().energy = 0.01;
       }},

      {"alone, as half", 0.99e-3, 1.01e-3,
       [](Scene& s, double energy) {
         alone(s);
         s.add(good_mode(23));
         s.add(good_mode(40)).reason = "some";
         s.modes.back().energy = energy;
       }},
      {"alone, as half", 2, 1,
       [](Scene& s, double stable) {
         alone(s);
         s.add(good_mode(40)).reason = "some";
         for (int i = 0; i < stable; ++i) s.add(good_mode(50));
       }},
      {"alone, as most", 1.49, 1.51,
       [](Scene& s, double whiteness) {
         alone(s);
         s.records.kind = MotionKind::kDriven;
         s.records.whiteness = whiteness;
         s.add(good_mode(23)).reason = "some";
         s.add(good_mode(40)).reason = "some";
       }},
      {"alone, as most", 1, 0,
       [](Scene& s, double believed) {
         alone(s);
         s.records.kind = MotionKind::kAmbient;
         s.records.whiteness = 2;
         s.add(good_mode(23)).reason = "some";
         s.add(good_mode(40)).reason = believed > 0 ? "" : "some";
       }},
  };
  return all;
}

TEST(Doubts, DecideEachByItselfBeyondTheirLimits) {
  for (const Limit& limit : limits()) {
    SCOPED_TRACE(limit.rule);
    const auto rule = std::find_if(doubts().begin(), doubts().end(), [&](const Rule& one) {
      return std::string(one.name) == limit.rule;
    });
    ASSERT_NE(rule, doubts().end());
    Scene inside, outside;
    limit.set(inside, limit.inside);
    limit.set(outside, limit.outside);
    std::vector<std::string> expected = {limit.rule};
    expected.insert(expected.end(), limit.weaker.begin(), limit.weaker.end());
    EXPECT_THAT(holding(rule->stage, outside), ElementsAreArray(expected));
    EXPECT_THAT(holding(rule->stage, inside), Not(Contains(limit.rule)));
    MeasuredMode mode;
    weigh(rule->stage, outside.evidence(), mode);
    EXPECT_EQ(mode.reason, rule->words);
    EXPECT_EQ(mode.not_linear, rule->not_linear);
  }
}

/// A hum and what is not repeated are found before they are weighed.
TEST(Doubts, AreAllTestedAndHaveNamesAndWordsOfTheirOwn) {
  std::set<std::string> tested = {"hum", "not repeated"}, names, words;
  for (const Limit& limit : limits()) tested.insert(limit.rule);
  for (const Rule& rule : doubts()) {
    names.insert(rule.name);
    words.insert(rule.words);
  }
  EXPECT_EQ(names, tested);
  EXPECT_EQ(names.size(), doubts().size());
  EXPECT_EQ(words.size(), doubts().size());
}

TEST(Doubts, SayNothingOfAGoodMode) {
  for (const Stage stage : {Stage::kParts, Stage::kLeftOver, Stage::kMode, Stage::kTogether}) {
    EXPECT_THAT(holding(stage, {}), IsEmpty());
  }
}

TEST(Doubts, StandInTheirOrderInTheDocumentation) {
  std::ifstream file(DASHPOT_SOURCE_DIR "/docs/identify.md");
  std::stringstream text;
  text << file.rdbuf();
  std::size_t at = 0;
  for (const Rule& rule : doubts()) {
    at = text.str().find("\n| " + std::string(rule.words) + " | ", at);
    ASSERT_NE(at, std::string::npos) << rule.words;
  }
}

TEST(Doubts, OfWhatIsNotAModeHaveWords) {
  MeasuredMode hum, other;
  weigh(Stage::kHum, {hum}, hum);
  weigh(Stage::kNotRepeated, {other}, other);
  EXPECT_EQ(hum.reason, "a steady hum, which was removed");
  EXPECT_EQ(other.reason, "parts of the records lack it: a nonlinearity or noise");
}

}  // namespace
}  // namespace dashpot::identification
