// Modes from motion under forces that nobody measured.
#include <dashpot/analysis/identification.hpp>
#include <dashpot/tests/support/released_springs.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::Draws;
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

/// How the modes found compare with the true ones.
struct Comparison {
  int modes = 0, found = 0, frequencies_inside = 0, ratios_inside = 0, false_ones = 0;

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
      frequencies_inside += std::abs(dw) < 1.96 * measured.natural_frequency_std ? 1 : 0;
      ratios_inside += std::abs(dz) < 1.96 * measured.damping_ratio_std ? 1 : 0;
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
  Draws draw;
  SprungArm arm;
  MatrixXd motion;
};

TEST(IdentifyAmbient, FindsTheModesOfShakenArmsWithinTheirDeviations) {
  DASHPOT_SKIP_IF_QUICK();
  Comparison all;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {  // the arms, twice
    ShakenArm shaken(seed);
    all.add(shaken.arm.modes,
            identify_ambient({sensed(shaken.motion, kPeriod, noise_of(1e-5, 0.002), shaken.draw)}));
  }
  EXPECT_GE(all.found, 0.85 * all.modes);
  EXPECT_GE(all.frequencies_inside, 0.88 * all.found);
  EXPECT_GE(all.ratios_inside, 0.88 * all.found);
  EXPECT_LE(all.frequencies_inside + all.ratios_inside, 1.99 * all.found);
  EXPECT_LE(all.false_ones, 1);
}

/// Lag zero has the noise of the sensors, which no other lag has.
TEST(IdentifyAmbient, DoesNotTakeTheSensorsNoiseForMotion) {
  ShakenArm shaken(2);
  Comparison noisy;
  noisy.add(shaken.arm.modes,
            identify_ambient({sensed(shaken.motion, kPeriod, noise_of(2e-3), shaken.draw)}));
  EXPECT_GE(noisy.found, 4);
  EXPECT_EQ(noisy.false_ones, 0);
}

TEST(IdentifyAmbient, TakesSeveralRecordsAsOne) {
  DASHPOT_SKIP_IF_QUICK();
  ShakenArm shaken(1);
  const auto part = [&](int from, int count) {
    return sensed(shaken.motion.middleCols(from, count), kPeriod, noise_of(1e-5), shaken.draw);
  };
  const Identification one = identify_ambient({part(0, kTwoMinutes)});
  std::vector<MotionRecord> records = {part(0, 10000), part(10000, 30000), part(40000, 20000)};
  records[1].output.array() += 0.3;  // each about a mean of its own
  const Identification three = identify_ambient(records);
  EXPECT_GE(three.modes.size(), one.modes.size() - 2);
  for (const MeasuredMode& mode : three.modes) {
    const auto near = [&mode](const MeasuredMode& other) {
      return std::abs(mode.natural_frequency - other.natural_frequency) <
             2 * other.natural_frequency_std;
    };
    EXPECT_TRUE(std::any_of(one.modes.begin(), one.modes.end(), near)) << mode.natural_frequency;
  }
  // Short ones, of which each has less than a twentieth of all.
  records.clear();
  for (int k = 0; k < 25; ++k) records.push_back(part(2400 * k, 2400));
  EXPECT_GE(identify_ambient(records).modes.size(), one.modes.size() - 2);
}

TEST(IdentifyAmbient, ShapesAreInTheChannelsUnits) {
  ShakenArm shaken(1);
  MotionRecord record = sensed(shaken.motion, kPeriod, noise_of(1e-5), shaken.draw);
  const Identification radians = identify_ambient({record});
  record.output.row(2) *= 180 / std::numbers::pi;
  const Identification mixed = identify_ambient({record});
  ASSERT_EQ(mixed.modes.size(), radians.modes.size());
  for (std::size_t k = 0; k < mixed.modes.size(); ++k) {
    const auto &a = radians.modes[k].shape, &b = mixed.modes[k].shape;
    EXPECT_NEAR(std::abs(b[2] / b[0]), 180 / std::numbers::pi * std::abs(a[2] / a[0]),
                1e-6 * std::abs(b[2] / b[0]));
  }
}

/// It hides no modes, and is none itself.
TEST(IdentifyAmbient, AHumIsTakenAway) {
  ShakenArm shaken(3);
  constexpr double kHum = 31;  // rad/s, where the arm moves
  const auto with_hum = [&](double size) {
    MatrixXd motion = shaken.motion;
    for (Eigen::Index i = 0; i < motion.cols(); ++i) {
      motion.col(i).array() += size * std::sin(kHum * kPeriod * static_cast<double>(i));
    }
    return identify_ambient({sensed(motion, kPeriod, noise_of(0), shaken.draw)});
  };
  const auto hums = [](const Identification& result) {
    std::vector<double> frequencies;
    for (const MeasuredMode& mode : result.rejected) {
      if (mode.reason == "a steady hum, taken away") {
        frequencies.push_back(mode.natural_frequency);
      }
    }
    return frequencies;
  };
  const Identification calm = with_hum(0);
  EXPECT_THAT(hums(calm), ::testing::IsEmpty());
  for (const double size : {0.01, 0.1}) {  // rad, beside about 0.01 of the arm's
    const Identification humming = with_hum(size);
    EXPECT_THAT(hums(humming), ::testing::ElementsAre(::testing::DoubleNear(kHum, 0.01))) << size;
    ASSERT_EQ(humming.modes.size(), calm.modes.size()) << size;
    for (std::size_t k = 0; k < calm.modes.size(); ++k) {
      const MeasuredMode &with = humming.modes[k], &without = calm.modes[k];
      EXPECT_LT(std::abs(with.natural_frequency - without.natural_frequency),
                without.natural_frequency_std);
      EXPECT_LT(std::abs(with.damping_ratio - without.damping_ratio), without.damping_ratio_std);
    }
  }
}

/// Its peaks are as sharp as a hum's, and wander.
TEST(IdentifyAmbient, AnArmThatRingsIsNotTakenForAHum) {
  Draws draw(5);
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

TEST(IdentifyAmbient, LongGapsPartARecord) {
  ShakenArm shaken(1);
  MotionRecord record = sensed(shaken.motion, kPeriod, noise_of(1e-5), shaken.draw);
  const Identification whole = identify_ambient({record});
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  record.output.middleCols(10000, 8000).setConstant(kNan);
  record.output.rightCols(42000).array() += 0.3;  // moved meanwhile
  record.output.row(3).segment(40000, 3000).setConstant(kNan);
  Comparison all;
  const Identification found = identify_ambient({record});
  all.add(shaken.arm.modes, found);
  EXPECT_EQ(all.false_ones, 0);
  EXPECT_GE(found.modes.size(), whole.modes.size() - 1);
}

/// As a joint that nothing moves.
TEST(IdentifyAmbient, AConstantChannelSaysNothing) {
  ShakenArm shaken(1);
  MotionRecord record = sensed(shaken.motion, kPeriod, noise_of(1e-5), shaken.draw);
  const Identification without = identify_ambient({record});
  record.output.conservativeResize(record.output.rows() + 1, Eigen::NoChange);
  record.output.bottomRows(1).setConstant(0.3);
  const Identification with = identify_ambient({record});
  EXPECT_GE(with.modes.size(), without.modes.size() - 1);
  for (const MeasuredMode& mode : with.modes) {
    EXPECT_LT(std::abs(mode.shape[mode.shape.size() - 1]), 1e-6);
  }
  for (const MeasuredMode& mode : with.rejected) EXPECT_GT(mode.natural_frequency, 0.01);
}

TEST(IdentifyAmbient, WhatOnlyHumsHasNoMode) {
  Draws draw(6);
  MatrixXd motion(1, 30000);
  for (Eigen::Index i = 0; i < motion.cols(); ++i) {
    motion(0, i) = std::sin(0.05 * static_cast<double>(i));
  }
  EXPECT_THAT(identify_ambient({sensed(motion, 0.01, noise_of(1e-5), draw)}).modes,
              ::testing::IsEmpty());
}

TEST(IdentifyAmbient, NoiseHasNoModes) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Draws draw(seed);
    MatrixXd motion(2, 20000);
    for (auto& y : motion.row(0)) y = draw.normal();
    motion.row(1).setConstant(0.3);
    const MotionRecord record = sensed(motion, 0.01, noise_of(0), draw);
    EXPECT_THAT(identify_ambient({record}).modes, ::testing::IsEmpty()) << "seed " << seed;
  }
  Draws draw(1);
  EXPECT_THROW(
      identify_ambient({sensed(MatrixXd::Constant(2, 20000, 0.3), 0.01, noise_of(0), draw)}),
      std::invalid_argument);
}

TEST(IdentifyAmbient, SaysWhatIsTooShort) {
  ShakenArm shaken(1);
  const MotionRecord record =
      sensed(shaken.motion.leftCols(400), kPeriod, noise_of(1e-5), shaken.draw);
  try {
    identify_ambient({record});
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("takes a longer record"));
  }
  EXPECT_THROW(identify_ambient({}), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::analysis
