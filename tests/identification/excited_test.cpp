#include <dashpot/identification/identification.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/released_springs.hpp>

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Dice;
using ::testing::HasSubstr;

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
