// Modes from motion under unmeasured forces.
#include <dashpot/identification/identification.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/released_springs.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace dashpot::identification {
namespace {

using analysis::Mode;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Dice;
using ::testing::HasSubstr;
using testing::sensed;
using testing::Sensors;
using testing::SprungArm;

constexpr double kPeriod = 0.002;  // s
constexpr double kStrength = 60;   // rad/s^2: about 0.01 rad of motion
constexpr int kTwoMinutes = 60000;

Sensors noise_of(double noise, double missing = 0) {
  Sensors sensors;
  sensors.noise = noise;
  sensors.missing = missing;
  return sensors;
}

/// The modes found beside the true ones.
struct Comparison {
  int modes = 0, found = 0, false_ones = 0;

  void add(const std::vector<Mode<>>& truth, const Identification& result) {
    std::vector<int> claims(truth.size());
    for (const MeasuredMode& measured : result.modes) {
      std::size_t best = 0;
      for (std::size_t k = 0; k < truth.size(); ++k) {
        if (distance(measured, truth[k]) < distance(measured, truth[best])) best = k;
      }
      const Mode<>& mode = truth[best];
      if (distance(measured, mode) > 0.2 * mode.natural_frequency || ++claims[best] > 1) {
        ++false_ones;
        continue;
      }
      ++found;
      const double dw = measured.natural_frequency - mode.natural_frequency;
      const double dz = measured.damping_ratio - mode.damping_ratio;
      EXPECT_LT(std::abs(dw), 5 * measured.natural_frequency_std);
      EXPECT_LT(std::abs(dz), 5 * measured.damping_ratio_std);
    }
    modes += static_cast<int>(truth.size());
  }

  static double distance(const MeasuredMode& measured, const Mode<>& mode) {
    return std::abs(measured.eigenvalues[0] - mode.eigenvalues[0]);
  }
};

/// One of the arms, with what it was shaken to for two minutes.
struct ShakenArm {
  explicit ShakenArm(std::uint64_t seed)
      : draw(seed),
        arm(seed, draw, 0.05, 0.4),
        motion(arm.shake(kStrength, kTwoMinutes, kPeriod, draw)) {}

  MotionRecord record(double noise, double missing = 0, int from = 0, int count = kTwoMinutes) {
    return sensed(motion.middleCols(from, count), kPeriod, noise_of(noise, missing), draw);
  }

  Dice draw;
  SprungArm arm;
  MatrixXd motion;
};

/// Lag zero has the noise of the sensors, which no other lag has.
TEST(IdentifyAmbient, DoesNotTakeTheSensorsNoiseForMotion) {
  ShakenArm shaken(2);
  Comparison noisy;
  noisy.add(shaken.arm.modes, identify_ambient({shaken.record(2e-3)}));
  EXPECT_GE(noisy.found, 4);
  EXPECT_EQ(noisy.false_ones, 0);
}

/// In several records, each about a mean of its own; in short ones, of which each has less than a
/// twentieth of all; with gaps; and in other units beside a joint that nothing moves.
TEST(IdentifyAmbient, FindsTheSameInTheSameMotionHoweverItIsRecorded) {
  DASHPOT_SKIP_IF_QUICK();
  ShakenArm shaken(1);
  const MotionRecord whole = shaken.record(1e-5);
  const Identification one = identify_ambient({whole});
  const auto expect_same = [&](const char* what, const std::vector<MotionRecord>& records,
                               std::size_t fewer) {
    const Identification found = identify_ambient(records);
    EXPECT_GE(found.modes.size() + fewer, one.modes.size()) << what;
    for (const MeasuredMode& mode : found.modes) {
      const auto near = [&mode](const MeasuredMode& other) {
        return std::abs(mode.natural_frequency - other.natural_frequency) <
               2 * other.natural_frequency_std;
      };
      EXPECT_TRUE(std::any_of(one.modes.begin(), one.modes.end(), near))
          << what << ' ' << mode.natural_frequency;
    }
    return found;
  };

  std::vector<MotionRecord> records = {part_of(whole, 0, 10000), part_of(whole, 10000, 40000),
                                       part_of(whole, 40000, kTwoMinutes)};
  records[1].output.array() += 0.3;
  expect_same("three", records, 2);
  records.clear();
  for (int k = 0; k < 25; ++k) records.push_back(part_of(whole, 2400 * k, 2400 * (k + 1)));
  expect_same("short", records, 2);

  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  MotionRecord gaps = whole;
  gaps.output.middleCols(10000, 8000).setConstant(kNan);
  gaps.output.rightCols(42000).array() += 0.3;  // moved meanwhile
  gaps.output.row(3).segment(40000, 3000).setConstant(kNan);
  expect_same("gaps", {gaps}, 1);

  MotionRecord mixed = whole;
  const Eigen::Index n = mixed.output.rows();
  constexpr double kDegrees = 180 / std::numbers::pi;
  mixed.output.row(2) *= kDegrees;
  mixed.output.conservativeResize(n + 1, Eigen::NoChange);
  mixed.output.bottomRows(1).setConstant(0.3);
  const Identification found = expect_same("mixed", {mixed}, 0);
  ASSERT_EQ(found.modes.size(), one.modes.size());
  for (std::size_t k = 0; k < one.modes.size(); ++k) {
    const auto &a = one.modes[k].shape, &b = found.modes[k].shape;
    EXPECT_NEAR(std::abs(b[2] / b[0]), kDegrees * std::abs(a[2] / a[0]),
                1e-6 * std::abs(b[2] / b[0]));
    EXPECT_LT(std::abs(b[n]), 1e-6);
  }
  for (const MeasuredMode& mode : found.rejected) EXPECT_GT(mode.natural_frequency, 0.01);
}

/// It hides no modes, and does not count as one.
TEST(IdentifyAmbient, AHumIsTakenAway) {
  ShakenArm shaken(3);
  constexpr double kHum = 31;  // rad/s, where the arm moves
  const auto with_hum = [&](double size) {
    MotionRecord record = shaken.record(0);
    for (Eigen::Index i = 0; i < record.time.size(); ++i) {
      record.output.col(i).array() += size * std::sin(kHum * record.time[i]);
    }
    return identify_ambient({record});
  };
  const auto hums = [](const Identification& result) {
    std::vector<double> frequencies;
    for (const MeasuredMode& mode : result.rejected) {
      if (mode.reason == "a steady hum, which was removed") {
        frequencies.push_back(mode.natural_frequency);
      }
    }
    return frequencies;
  };
  const Identification calm = with_hum(0), humming = with_hum(0.1);  // rad, ten times the arm's
  EXPECT_THAT(hums(calm), ::testing::IsEmpty());
  EXPECT_THAT(hums(humming), ::testing::ElementsAre(::testing::DoubleNear(kHum, 0.01)));
  ASSERT_EQ(humming.modes.size(), calm.modes.size());
  for (std::size_t k = 0; k < calm.modes.size(); ++k) {
    const MeasuredMode &with = humming.modes[k], &without = calm.modes[k];
    EXPECT_LT(std::abs(with.natural_frequency - without.natural_frequency),
              without.natural_frequency_std);
    EXPECT_LT(std::abs(with.damping_ratio - without.damping_ratio), without.damping_ratio_std);
  }
}

/// Its peaks are as sharp as a hum's, and wander.
TEST(IdentifyAmbient, AnArmThatRingsIsNotTakenForAHum) {
  Dice draw(5);
  const SprungArm arm(2, draw, 0.003, 0.006);
  const Identification result = identify_ambient(
      {sensed(arm.shake(kStrength, kTwoMinutes, kPeriod, draw), kPeriod, noise_of(1e-5), draw)});
  Comparison all;
  all.add(arm.modes, result);
  EXPECT_GE(all.found, all.modes - 1);
  EXPECT_EQ(all.false_ones, 0);
  for (const MeasuredMode& mode : result.rejected) {
    EXPECT_THAT(mode.reason, ::testing::Not(HasSubstr("hum"))) << mode.natural_frequency;
  }
}

TEST(IdentifyAmbient, WhatOnlyHumsOrIsNoiseHasNoModes) {
  for (std::uint64_t seed = 0; seed <= 3; ++seed) {  // 0: a hum
    Dice draw(seed);
    MatrixXd motion(2, 20000);
    for (Eigen::Index i = 0; i < motion.cols(); ++i) {
      motion(0, i) = seed == 0 ? std::sin(0.05 * static_cast<double>(i)) : draw.normal();
    }
    motion.row(1).setConstant(0.3);
    const MotionRecord record = sensed(motion, 0.01, noise_of(seed == 0 ? 1e-5 : 0), draw);
    EXPECT_THAT(identify_ambient({record}).modes, ::testing::IsEmpty()) << "seed " << seed;
  }
}

TEST(IdentifyAmbient, RefusesWhatIsTooShortOrRests) {
  Dice draw(1);
  MatrixXd motion(2, 400);
  for (double& y : motion.reshaped()) y = draw.normal();
  EXPECT_THAT(testing::refusal<std::invalid_argument>(
                  [&] { identify_ambient({sensed(motion, kPeriod, noise_of(1e-5), draw)}); }),
              HasSubstr("takes a longer record"));
  EXPECT_THROW(identify_ambient({}), std::invalid_argument);
  const MatrixXd rest = MatrixXd::Constant(2, 20000, 0.3);
  EXPECT_THROW(identify_ambient({sensed(rest, 0.01, noise_of(0), draw)}), std::invalid_argument);
}

/// Six seconds of two modes, 9 rad/s at 0.12 and 24 rad/s at 0.8, that move already and that a
/// chirp of 0.3 to 8 Hz moves, at 500 Hz; 3 % of the samples are missing.
MotionRecord chirped(Dice& draw, double start, double noise = 1e-5) {
  constexpr int kSamples = 3000;
  constexpr double kStep = 0.002;
  MotionRecord record{VectorXd(kSamples), MatrixXd(2, kSamples), MatrixXd(1, kSamples)};
  struct Oscillator {
    double w, z, x, v = 0;
    void step(double u) {  // exactly, about u
      const double d = w * std::sqrt(1 - z * z), y = x - u, b = (v + z * w * y) / d;
      const double fade = std::exp(-z * w * kStep);
      const double c = std::cos(d * kStep), s = std::sin(d * kStep);
      const double next = fade * (y * c + b * s);
      v = fade * (b * c - y * s) * d - z * w * next;
      x = next + u;
    }
  };
  Oscillator first{9, 0.12, start}, second{24, 0.8, -start};
  for (int i = 0; i < kSamples; ++i) {
    const double t = kStep * i, u = std::sin(2 * std::numbers::pi * t * (0.3 + 0.64 * t));
    record.time[i] = t;
    record.input(0, i) = 3 * u;
    const bool missing = draw.uniform(0, 1) < 0.03;
    record.output(0, i) = 0.3 + first.x + second.x / 2 + noise * draw.normal();
    record.output(1, i) = -1 + first.x / 2 - second.x + noise * draw.normal();
    if (missing) record.output.col(i).setConstant(std::numeric_limits<double>::quiet_NaN());
    first.step(0.005 * u);
    second.step(0.02 * u);
  }
  return record;
}

void expect_modes(const Identification& found) {
  ASSERT_EQ(found.modes.size(), 2U);
  const std::array<double, 2> w{9, 24}, z{0.12, 0.8};
  for (std::size_t k = 0; k < 2; ++k) {
    const MeasuredMode& mode = found.modes[k];
    EXPECT_NEAR(mode.natural_frequency, w[k], 3.5 * mode.natural_frequency_std);
    EXPECT_NEAR(mode.damping_ratio, z[k], 3.5 * mode.damping_ratio_std);
    EXPECT_LT(mode.natural_frequency_std, 2e-3 * w[k]);
    EXPECT_LT(mode.damping_ratio_std, 2e-3);
  }
  EXPECT_NEAR(found.modes[0].shape[1].real() / found.modes[0].shape[0].real(), 0.5, 0.01);
  EXPECT_NEAR(found.modes[1].shape[0].real() / found.modes[1].shape[1].real(), -0.5, 0.01);
}

TEST(IdentifyExcited, FindsModesInOneRecordAndInTwoBesideAChannelThatRests) {
  Dice one(41);
  expect_modes(identify_excited({chirped(one, 0.01)}));
  Dice draw(42);
  std::vector<MotionRecord> records{chirped(draw, 0.01), chirped(draw, -0.005)};
  for (MotionRecord& record : records) {
    record.output.conservativeResize(3, Eigen::NoChange);
    record.output.row(2).setConstant(0.7);
  }
  for (Index i = 0; i < records[1].time.size(); ++i) records[1].time[i] += 7;
  records[1] = part_of(records[1], 0, 2000);
  const Identification found = identify_excited(records);
  expect_modes(found);
  EXPECT_EQ(found.modes[0].shape.size(), 3);
  EXPECT_EQ(found.modes[0].shape[2], 0.0);
  EXPECT_EQ(found.noise[2], 0);
}

TEST(IdentifyExcited, RefusesRecordsWithoutInputs) {
  Dice draw(43);
  const MotionRecord good = chirped(draw, 0);
  const auto message = [](const MotionRecord& record) {
    return testing::refusal<std::invalid_argument>([&] { identify_excited({record}); });
  };
  MotionRecord bad = good;
  bad.input.resize(0, 0);
  EXPECT_THAT(message(bad), HasSubstr("no inputs"));
  bad = good;
  bad.input.setConstant(2);
  EXPECT_THAT(message(bad), HasSubstr("no input moves"));
  bad.input(0, 5) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(bad), HasSubstr("not finite"));
  bad.input.resize(1, 7);
  EXPECT_THAT(message(bad), HasSubstr("inputs x samples"));
}

}  // namespace
}  // namespace dashpot::identification
