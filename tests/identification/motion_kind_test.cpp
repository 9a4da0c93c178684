// The kind of motion in a record, whatever its scales, offsets, drift and digits.
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/motion_verdict.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Dice;

constexpr double kPi = std::numbers::pi;

/// Two channels of `samples`, `step` (s) apart, of a motion of two coordinates.
MotionRecord record_of(Index samples, double step, Dice& draw, double noise,
                       const std::function<std::array<double, 2>(Index)>& motion) {
  MotionRecord record{VectorXd(samples), MatrixXd(2, samples), {}};
  for (Index i = 0; i < samples; ++i) {
    record.time[i] = step * static_cast<double>(i);
    const auto [x, y] = motion(i);
    record.output.col(i) << 0.02 * x + 0.01 * y + noise * draw.normal(),
        0.01 * x - 0.02 * y + noise * draw.normal();
  }
  return record;
}

/// Rest, and from 0.5 s on decays of 9 rad/s at 0.06 and of 14 rad/s at 0.1.
MotionRecord push(Dice& draw, double step = 0.002, Index samples = 2000) {
  return record_of(samples, step, draw, 1e-5, [step](Index i) -> std::array<double, 2> {
    const double t = step * static_cast<double>(i) - 0.5;
    if (t < 0) return {0, 0};
    return {std::exp(-0.06 * 9 * t) * std::sin(9 * std::sqrt(1 - 0.06 * 0.06) * t),
            std::exp(-0.1 * 14 * t) * std::sin(14 * std::sqrt(1 - 0.1 * 0.1) * t)};
  });
}

/// Oscillators under white forces, which are its input.
MotionRecord forced(Dice& draw) {
  struct Oscillator {
    double w, z, x = 0, v = 0;
    void step(double t, double kick) {
      for (int part = 0; part < 10; ++part) {
        v += t / 10 * (-w * w * x - 2 * z * w * v);
        x += t / 10 * v;
      }
      v += kick;
    }
  };
  Oscillator one{9, 0.05}, two{14, 0.1};
  MatrixXd forces(2, 8000);
  MotionRecord record = record_of(8000, 0.01, draw, 1e-5, [&](Index i) -> std::array<double, 2> {
    const std::array<double, 2> motion{one.x, two.x};
    forces.col(i) << draw.normal(), draw.normal();
    one.step(0.01, 0.5 * forces(0, i));
    two.step(0.01, 0.5 * forces(1, i));
    return motion;
  });
  record.input = forces;
  return record;
}

/// The same, as far as somebody knows who did not measure them.
MotionRecord shaken(Dice& draw) {
  MotionRecord record = forced(draw);
  record.input.resize(0, 0);
  return record;
}

/// Van der Pol's oscillator from a small start, of which the other coordinate has a half.
MotionRecord cycle(Dice& draw) {
  double x = 0.1, v = 0;
  return record_of(3000, 0.01, draw, 1e-5, [&](Index) -> std::array<double, 2> {
    for (int part = 0; part < 100; ++part) {
      v += 1e-4 * (1.7 * (1 - x * x) * v - 32 * x);
      x += 1e-4 * v;
    }
    return {x, x / 2};
  });
}

MotionRecord noise_alone(Dice& draw) {
  return record_of(2000, 0.01, draw, 1e-5, [](Index) -> std::array<double, 2> { return {0, 0}; });
}

struct Kind {
  std::string name;
  MotionKind kind;
  std::function<MotionRecord(Dice&)> record;
};

std::vector<Kind> kinds() {
  return {{"push", MotionKind::kDecays, [](Dice& draw) { return push(draw); }},
          {"shaken", MotionKind::kAmbient, shaken},
          {"cycle", MotionKind::kLimitCycle, cycle},
          {"noise", MotionKind::kNothing, noise_alone}};
}

/// A change of a record by sensors and units.
struct Change {
  std::string name;
  double time = 1, size = 1, offset = 0, drift = 0, digit = 0;

  MotionRecord of(MotionRecord record) const {
    const auto N = static_cast<double>(record.time.size());
    record.time *= time;
    for (Index i = 0; i < record.output.cols(); ++i) {
      record.output.col(i).array() += offset + drift * static_cast<double>(i) / N;
    }
    record.output *= size;
    if (digit > 0) record.output = (record.output / digit).array().round() * digit;
    return record;
  }
};

const std::array<Change, 8> kChanges = {{{"as it is"},
                                         {"slow", 1e3},
                                         {"fast", 1e-3},
                                         {"large", 1, 1e3},
                                         {"small", 1, 1e-3},
                                         {"offset", 1, 1, 5},
                                         {"drift", 1, 1, 0, 0.004},
                                         {"digits", 1, 1, 0, 0, 1e-4}}};

TEST(MotionKind, IsThatOfTheRecordInAnyScale) {
  for (const Kind& kind : kinds()) {
    for (const Change& change : kChanges) {
      SCOPED_TRACE(kind.name + ", " + change.name);
      if (kind.kind == MotionKind::kNothing && change.drift > 0) continue;
      Dice draw(71);
      EXPECT_EQ(judge_motion(change.of(kind.record(draw))).kind, kind.kind);
    }
  }
}

TEST(MotionKind, TellsTheFrequencyOfACycle) {
  Dice draw(72);
  const MotionRecord record = cycle(draw);
  const MotionVerdict verdict = judge_motion(record);
  // By its passages through zero in the second half.
  double first = 0, last = 0;
  int passages = -1;
  for (Index i = record.time.size() / 2; i + 1 < record.time.size(); ++i) {
    const double a = record.output(0, i), b = record.output(0, i + 1);
    if (!(a < 0 && b >= 0)) continue;
    last = record.time[i] + 0.01 * a / (a - b);
    if (++passages == 0) first = last;
  }
  EXPECT_NEAR(verdict.frequency, 2 * kPi * passages / (last - first), 0.002);
  EXPECT_LT(verdict.harmonics, 0.1);
}

/// The modes that decays in a record show.
Identification modes_of(const MotionRecord& record) {
  std::vector<MotionRecord> decays;
  for (const FreeDecay& decay : find_decays(record)) {
    if (decay.reason.empty()) decays.push_back(part_of(record, decay.from, decay.to));
  }
  return decays.empty() ? Identification{} : identify_decays(decays);
}

TEST(MotionKind, DecaysGiveTheSameModesInAnyScale) {
  const std::array<double, 2> w{9, 14}, z{0.06, 0.1};
  std::vector<MeasuredMode> plain;
  for (const Change& change : kChanges) {
    SCOPED_TRACE(change.name);
    Dice draw(73);
    const Identification found = modes_of(change.of(push(draw)));
    ASSERT_EQ(found.modes.size(), 2U);
    if (plain.empty()) plain = found.modes;
    const bool same = change.drift == 0 && change.digit == 0;
    for (std::size_t k = 0; k < 2; ++k) {
      const MeasuredMode& mode = found.modes[k];
      const double frequency = mode.natural_frequency * change.time;
      EXPECT_NEAR(frequency, w[k], 4 * mode.natural_frequency_std * change.time);
      EXPECT_NEAR(mode.damping_ratio, z[k], 4 * mode.damping_ratio_std);
      EXPECT_LT(mode.natural_frequency_std * change.time, 1e-3 * w[k]);
      // Rounding of what an offset makes large is rounding of the noise.
      const double rounding = same ? 1e-6 : 1e-3;
      EXPECT_NEAR(frequency, plain[k].natural_frequency, rounding * w[k]);
      EXPECT_NEAR(mode.damping_ratio, plain[k].damping_ratio, rounding);
    }
  }
}

/// Motion under forces, known or not, in other units of time and length, about another mean.
TEST(MotionKind, ForcedMotionGivesTheSameModesInAnyScale) {
  DASHPOT_SKIP_IF_QUICK();
  const std::array<double, 2> w{9, 14}, z{0.05, 0.1};
  for (const bool known : {true, false}) {
    std::vector<MeasuredMode> plain;
    for (const Change& change : kChanges) {
      if (change.drift > 0 || change.digit > 0) continue;
      SCOPED_TRACE(change.name + (known ? ", known" : ", unknown"));
      Dice draw(79);
      const MotionRecord record = change.of(known ? part_of(forced(draw), 0, 1500) : shaken(draw));
      const Identification found = known ? identify_excited({record}) : identify_ambient({record});
      ASSERT_EQ(found.modes.size(), 2U);
      if (plain.empty()) plain = found.modes;
      for (std::size_t k = 0; k < 2; ++k) {
        const MeasuredMode& mode = found.modes[k];
        const double frequency = mode.natural_frequency * change.time;
        // The steps of the simulation are wrong by a part in a thousand.
        EXPECT_NEAR(frequency, w[k], 1e-3 * w[k] + 4 * mode.natural_frequency_std * change.time);
        EXPECT_NEAR(mode.damping_ratio, z[k], 1e-3 + 4 * mode.damping_ratio_std);
        EXPECT_NEAR(frequency, plain[k].natural_frequency, 1e-6 * w[k]);
        EXPECT_NEAR(mode.damping_ratio, plain[k].damping_ratio, 1e-6);
      }
    }
  }
}

TEST(MotionKind, DecaysAreFoundWithFewSamplesInAPeriod) {
  Dice draw(74);
  const Identification found = modes_of(push(draw, 0.1, 120));
  ASSERT_EQ(found.modes.size(), 2U);
  EXPECT_NEAR(found.modes[0].natural_frequency, 9, 0.01);
  EXPECT_NEAR(found.modes[1].natural_frequency, 14, 0.02);
}

/// An oscillator of 10 rad/s at 0.03 that rubs: the force of 40 um of its spring's travel.
TEST(MotionKind, FrictionMakesNoModesAndItsDeviationsHold) {
  for (const std::uint64_t seed : {75U, 76U, 77U, 78U}) {
    SCOPED_TRACE(seed);
    Dice draw(seed);
    double x = draw.uniform(0.6, 1), v = 0;
    const MotionRecord record =
        record_of(2000, 0.004, draw, 5e-4 * 0.02, [&](Index) -> std::array<double, 2> {
          for (int part = 0; part < 40; ++part) {
            const double rubs = 100 * 0.002 * std::tanh(v / 1e-3);
            v += 1e-4 * (-0.6 * v - 100 * x - rubs);
            x += 1e-4 * v;
          }
          return {x, x / 2};
        });
    const Identification found = identify_decays({record});
    ASSERT_LE(found.modes.size(), 1U);
    for (const MeasuredMode& mode : found.modes) {
      EXPECT_NEAR(mode.natural_frequency, 10, 3 * mode.natural_frequency_std);
      EXPECT_NEAR(mode.damping_ratio, 0.03, 3 * mode.damping_ratio_std);
    }
  }
}

}  // namespace
}  // namespace dashpot::identification
