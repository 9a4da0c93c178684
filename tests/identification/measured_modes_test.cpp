// Which measured modes are believed, and their stability diagrams.
#include <dashpot/identification/search/measured_modes.hpp>
#include <dashpot/tests/identification/good_mode.hpp>

#include <gmock/gmock.h>

#include <cmath>
#include <complex>
#include <limits>
#include <string>
#include <vector>

namespace dashpot::identification {
namespace {

using Eigen::VectorXcd;
using ::testing::HasSubstr;
using ::testing::StartsWith;

MeasuredMode decay(double rate, double std) {
  MeasuredMode mode = good_mode();
  mode.eigenvalues = {-rate, -rate};
  mode.natural_frequency = rate;
  mode.natural_frequency_std = std;
  mode.damping_ratio = 1;
  mode.damping_ratio_std = std::numeric_limits<double>::infinity();
  return mode;
}

Identification judged(const std::vector<MeasuredMode>& modes, double duration = 10,
                      double whiteness = 1, bool decays = false) {
  Identification result;
  const RecordFacts records{.duration = duration,
                            .step = 1e-3,
                            .kind = decays ? MotionKind::kDecays : MotionKind::kAmbient,
                            .whiteness = whiteness};
  judge(modes, records, result);
  return result;
}

/// Why the first of these modes is rejected; empty if it is not.
std::string reason(const std::vector<MeasuredMode>& modes, double duration = 10,
                   double whiteness = 1, bool decays = false) {
  for (const MeasuredMode& mode : judged(modes, duration, whiteness, decays).rejected) {
    if (mode.natural_frequency == modes[0].natural_frequency) return mode.reason;
  }
  return "";
}

TEST(MeasuredModes, KeepAReasonOfTheirOwn) {
  EXPECT_EQ(reason({good_mode()}), "");
  MeasuredMode has_one = good_mode();
  has_one.reason = "of its own";
  EXPECT_EQ(reason({has_one}), "of its own");
}

/// An overdamped ratio is determined relative to itself.
TEST(MeasuredModes, MayHaveALargeRatioThatIsLessSure) {
  MeasuredMode mode = good_mode();
  mode.eigenvalues = {-2, -50};
  mode.damping_ratio = 2.6;
  mode.damping_ratio_std = 0.12;
  EXPECT_EQ(reason({mode}), "");
  mode.damping_ratio_std = 0.14;
  EXPECT_THAT(reason({mode}), StartsWith("its damping ratio is not determined"));
}

/// Neither three radians of oscillation nor a decay to 1/e are in the record.
TEST(MeasuredModes, AreTooSlowOnlyIfNeitherTheirWaveNorTheirDecayIsThere) {
  EXPECT_EQ(reason({good_mode(10, 0.1)}, 0.31), "");
  EXPECT_EQ(reason({good_mode(10, 0.1)}, 0.30), "too slow for the record");
  EXPECT_EQ(reason({good_mode(10, 0.5)}, 0.21), "");
  EXPECT_EQ(reason({good_mode(10, 0.5)}, 0.19), "too slow for the record");
  MeasuredMode overdamped = good_mode();
  overdamped.eigenvalues = {-1, -100};
  overdamped.damping_ratio = 5.05;
  EXPECT_EQ(reason({overdamped}, 0.2), "");
}

TEST(MeasuredModes, LikeALargerOneNextToThemAreItsOwnChange) {
  const auto beside = [](double w, double energy, const VectorXcd& shape) {
    MeasuredMode larger = good_mode(w);
    larger.energy = energy;
    larger.shape = shape;
    return reason({good_mode(), larger});
  };
  const char* const text = "like a larger mode next to it: its frequency changes with its size";
  EXPECT_EQ(beside(10.4, 1.1, shape_of(1, 0.4)), text);
  EXPECT_EQ(beside(10.6, 1.1, shape_of(1, 0.4)), "");
  EXPECT_EQ(beside(10.4, 0.9, shape_of(1, 0.4)), "the same as a larger mode next to it");
  EXPECT_EQ(beside(10.4, 1.1, shape_of(1, 0.6)), "");
}

/// A motion that is over at once has no harmonics, so it may be at three times another frequency.
TEST(MeasuredModes, AtThreeTimesTheFrequencyOfALargerOneAreNoneIfLightlyDamped) {
  const auto at = [](double times, double ratio) {
    MeasuredMode larger = good_mode(10, 0.05);
    const double w = times * larger.eigenvalues[0].imag();
    MeasuredMode mode = good_mode(w / std::sqrt(1 - ratio * ratio), ratio);
    mode.natural_frequency_std = 1e-3 * w;
    mode.shape = shape_of(0, 1);
    mode.energy = 0.04;
    return reason({mode, larger});
  };
  EXPECT_THAT(at(3, 0.05), StartsWith("three times the frequency"));
  EXPECT_THAT(at(3, 0.29), StartsWith("three times the frequency"));
  EXPECT_EQ(at(3, 0.31), "");
  EXPECT_EQ(at(3.3, 0.05), "");
}

TEST(MeasuredModes, AtTheSumOfTwoMuchLargerOnesAreNone) {
  const Complex a = oscillation(23, 0.05), b = oscillation(40, 0.1);
  const auto at = [&](const Complex& value, double energy) {
    MeasuredMode first = good_mode(23, 0.05), second = good_mode(40, 0.1), small = good_mode();
    first.shape = shape_of(0, 1);
    second.shape = shape_of(1, 1);
    first.energy = 0.4;
    second.energy = energy;
    small.energy = 0.01;
    small.eigenvalues = {value, std::conj(value)};
    small.natural_frequency = std::abs(value);
    small.natural_frequency_std = 1e-4 * std::abs(value);
    small.damping_ratio = -value.real() / std::abs(value);
    return reason({small, first, second});
  };
  const char* const text = "the sum of two eigenvalues of larger modes";
  const Complex up = std::polar(1.0, 0.3);
  EXPECT_THAT(at(a + b, 0.4), HasSubstr(text));
  EXPECT_THAT(at(std::conj(a) + b, 0.4), HasSubstr(text));
  EXPECT_THAT(at(a + a, 0.4), HasSubstr(text));
  EXPECT_THAT(at((a + b) * (1.0 + 0.0019 * up), 0.4), HasSubstr(text));
  EXPECT_EQ(at((a + b) * (1.0 + 0.0022 * up), 0.4), "");
  EXPECT_THAT(at(a + b, 0.051), HasSubstr(text));
  EXPECT_EQ(at(a + b, 0.049), "");
  EXPECT_EQ(at(a + b, 101), "");  // which cancels, and is not known itself
}

/// A model with many doubtful modes shows that the record is not a sum of decays.
TEST(MeasuredModes, OfOneOrderAloneAreBelievedAmongFewThatAreNot) {
  MeasuredMode alone = good_mode(10), first = good_mode(23), second = good_mode(40);
  alone.stability = 0;
  first.shape = shape_of(0, 1);
  first.energy = second.energy = 200;  // none
  EXPECT_EQ(reason({alone, first}), "");
  EXPECT_EQ(reason({alone, first, second}), "");  // the rest is white
  EXPECT_THAT(reason({alone, first, second}, 10, 2), StartsWith("in no model of another order"));
  alone.stability = 0.1;
  EXPECT_EQ(reason({alone, first, second}, 10, 2), "");
}

/// A model of friction explains a decay to its noise with modes that no other model has.
TEST(MeasuredModes, OfADecayThatOneOrderAloneHasAreBelievedAmongMoreThatAllHave) {
  const auto at = [](int stable, int alone, bool rejects, double energy = 200) {
    std::vector<MeasuredMode> modes;
    for (int i = 0; i < stable + alone; ++i) {
      modes.insert(modes.begin(), good_mode(10 + 7 * i));
      modes.front().shape = shape_of(i, 1);
      modes.front().stability = i < stable ? 1 : 0;
    }
    if (rejects) {
      modes.push_back(good_mode(100));
      modes.back().energy = energy;
    }
    return reason(modes, 10, 1, true);
  };
  EXPECT_EQ(at(3, 2, true), "");
  EXPECT_EQ(at(0, 4, false), "");  // nothing else in the model
  EXPECT_THAT(at(2, 2, true), StartsWith("in no model of another order, like half of this"));
  EXPECT_EQ(at(2, 2, true, 1e-7), "");  // too weak to count
  EXPECT_THAT(at(0, 1, true), StartsWith("in no model of another order, like half of this"));
}

TEST(MeasuredModes, OfDecaysMayBeLessSureButHaveToDecay) {
  MeasuredMode mode = good_mode();
  mode.natural_frequency_std = 0.55;
  mode.damping_ratio_std = 0.055;
  EXPECT_EQ(reason({mode}, 10, 1, true), "");
  mode.natural_frequency_std = 0.61;
  EXPECT_EQ(reason({mode}, 10, 1, true), "its frequency is not determined");
  EXPECT_EQ(reason({good_mode(10, 0.011)}, 10, 1, true), "");
  EXPECT_EQ(reason({good_mode(10, 0.009)}, 10, 1, true), "it does not decay within its deviation");
  EXPECT_EQ(reason({good_mode(10, 0.009)}), "");
}

TEST(MeasuredModes, OfASingleDecayArePairedByTheirShapes) {
  const double x = -3, y = -12, w = 6, sx = 0.03, sy = 0.2;
  MeasuredMode slow = decay(3, sx), fast = decay(12, sy), other = decay(5, 0.1);
  fast.shape = shape_of(1, 0.2);
  fast.energy = 0.25;
  fast.stability = 0.5;
  other.shape = shape_of(0, 1);
  for (const auto& modes : {std::vector{other, slow, fast}, std::vector{fast, other, slow}}) {
    const Identification result = judged(modes);
    ASSERT_EQ(result.modes.size(), 1u);
    const MeasuredMode& mode = result.modes[0];
    EXPECT_DOUBLE_EQ(mode.natural_frequency, w);
    EXPECT_DOUBLE_EQ(mode.damping_ratio, 15 / (2 * w));
    EXPECT_DOUBLE_EQ(mode.eigenvalues[0].real(), x);
    EXPECT_DOUBLE_EQ(mode.eigenvalues[1].real(), y);
    EXPECT_EQ(mode.shape, slow.shape);
    EXPECT_DOUBLE_EQ(mode.energy, 0.75);
    EXPECT_DOUBLE_EQ(mode.stability, 0.5);
    // First-order propagation by differences.
    const auto frequency = [](double p, double q) { return std::sqrt(p * q); };
    const auto ratio = [](double p, double q) { return -(p + q) / (2 * std::sqrt(p * q)); };
    const auto spread = [&](const auto& f) {
      const double h = 1e-5;
      return std::hypot((f(x + h, y) - f(x - h, y)) / (2 * h) * sx,
                        (f(x, y + h) - f(x, y - h)) / (2 * h) * sy);
    };
    EXPECT_NEAR(mode.natural_frequency_std, spread(frequency), 1e-8);
    EXPECT_NEAR(mode.damping_ratio_std, spread(ratio), 1e-8);
    ASSERT_EQ(result.rejected.size(), 1u);
    EXPECT_THAT(result.rejected[0].reason, StartsWith("a decay without oscillation"));
    EXPECT_EQ(result.rejected[0].natural_frequency, 5);
  }
}

TEST(MeasuredModes, AreListedByRisingFrequency) {
  MeasuredMode bad = good_mode(20);
  bad.energy = 1000;
  MeasuredMode worse = good_mode(15);
  worse.energy = 1000;
  const Identification result = judged({good_mode(33), bad, good_mode(12), worse});
  ASSERT_EQ(result.modes.size(), 2u);
  EXPECT_EQ(result.modes[0].natural_frequency, 12);
  ASSERT_EQ(result.rejected.size(), 2u);
  EXPECT_EQ(result.rejected[0].natural_frequency, 15);
}

/// A pole of order 2 beside one that the model of order 1 has.
bool stable_beside(const RealizedPole& before, const RealizedPole& pole) {
  const std::vector<ModelPole> poles = model_poles({{before}, {pole}});
  EXPECT_EQ(poles.size(), 2u);
  EXPECT_EQ(poles.at(0).order, 1);
  EXPECT_FALSE(poles.at(0).stable);
  EXPECT_EQ(poles.at(1).order, 2);
  EXPECT_NEAR(poles.at(1).natural_frequency, std::abs(pole.eigenvalue), 1e-12);
  return poles.at(1).stable;
}

TEST(ModelPoles, AreStableWithinTheLimitsThatTheirDocumentationNames) {
  const RealizedPole before{oscillation(10, 0.1), shape_of(1, 0)};
  EXPECT_NEAR(model_poles({{before}})[0].damping_ratio, 0.1, 1e-12);
  EXPECT_TRUE(stable_beside(before, before));
  EXPECT_TRUE(stable_beside(before, {oscillation(10.09, 0.1), shape_of(1, 0)}));
  EXPECT_FALSE(stable_beside(before, {oscillation(10.11, 0.1), shape_of(1, 0)}));
  EXPECT_TRUE(stable_beside(before, {oscillation(10, 0.119), shape_of(1, 0)}));
  EXPECT_FALSE(stable_beside(before, {oscillation(10, 0.121), shape_of(1, 0)}));
  EXPECT_TRUE(stable_beside(before, {oscillation(10, 0.1), shape_of(1, 0.22)}));   // MAC 0.954
  EXPECT_FALSE(stable_beside(before, {oscillation(10, 0.1), shape_of(1, 0.24)}));  // MAC 0.946
}

TEST(ModelPoles, GiveAModeTheShareOfModelsThatHaveIt) {
  MeasuredMode mode = good_mode();
  mode.natural_frequency_std = 0.1;
  const auto pole = [](double w, double y) {
    return RealizedPole{oscillation(w, 0.1), shape_of(1, y)};
  };
  // From order 3 on: as it is; nearly so; with a second one; too far; of another shape; none.
  const std::vector<std::vector<RealizedPole>> by_order = {{},
                                                           {pole(10, 0)},
                                                           {pole(10, 0)},
                                                           {pole(10.4, 0.3)},
                                                           {pole(10, 0), pole(10.1, 0)},
                                                           {pole(10.6, 0)},
                                                           {pole(10, 0.4)},
                                                           {}};
  EXPECT_DOUBLE_EQ(stability_of(mode, by_order, 3), 3.0 / 6);
  EXPECT_DOUBLE_EQ(stability_of(mode, by_order, 8), 0);
  EXPECT_DOUBLE_EQ(stability_of(mode, by_order, 9), 0);
  mode.natural_frequency_std = 0.35;  // less sure: two deviations reach further
  EXPECT_DOUBLE_EQ(stability_of(mode, by_order, 3), 4.0 / 6);
}

}  // namespace
}  // namespace dashpot::identification
