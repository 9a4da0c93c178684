#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/model/decay_columns.hpp>
#include <dashpot/identification/model/decay_data.hpp>
#include <dashpot/identification/model/decay_fit.hpp>
#include <dashpot/identification/search/model_search.hpp>
#include <dashpot/tests/support/random.hpp>
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

/// A decay of known modes: two coupled channels, at uneven times if `jitter`.
struct KnownDecay {
  double w1 = 9, z1 = 0.12, w2 = 14, z2 = 0.55;

  MotionRecord record(double noise, double jitter, Dice& draw, double phase = 0) const {
    constexpr int kSamples = 1200;
    MotionRecord record{VectorXd(kSamples), MatrixXd(2, kSamples)};
    for (int i = 0; i < kSamples; ++i) {
      const double t = 0.002 * (i + jitter * draw.uniform(-0.4, 0.4));
      record.time[i] = t;
      const double x = std::exp(-z1 * w1 * t) * std::cos(w1 * std::sqrt(1 - z1 * z1) * t + phase);
      const double y = std::exp(-z2 * w2 * t) * std::cos(w2 * std::sqrt(1 - z2 * z2) * t - phase);
      record.output(0, i) = 0.3 + 0.02 * x + 0.01 * y + noise * draw.normal();
      record.output(1, i) = -1 + 0.01 * x - 0.02 * y + noise * draw.normal();
    }
    return record;
  }

  void expect_in(const Identification& found, double deviations) const {
    ASSERT_EQ(found.modes.size(), 2U);
    const std::array<double, 2> w{w1, w2}, z{z1, z2};
    for (std::size_t k = 0; k < 2; ++k) {
      const MeasuredMode& mode = found.modes[k];
      EXPECT_NEAR(mode.natural_frequency, w[k], deviations * mode.natural_frequency_std);
      EXPECT_NEAR(mode.damping_ratio, z[k], deviations * mode.damping_ratio_std);
      EXPECT_LT(mode.natural_frequency_std, 1e-3 * w[k]);
    }
    // In phase and out of phase, by construction.
    EXPECT_NEAR(found.modes[0].shape[1].real() / found.modes[0].shape[0].real(), 0.5, 0.01);
    EXPECT_NEAR(found.modes[1].shape[0].real() / found.modes[1].shape[1].real(), -0.5, 0.01);
  }
};

/// At even times, at times as they are, and with samples missing in either channel.
TEST(IdentifyDecays, FindsKnownModesWithinTheirDeviations) {
  const KnownDecay decay;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const auto& [seed, jitter, missing] :
       {std::tuple(11, 0.0, 0.0), {12, 1.0, 0.0}, {13, 0.0, 0.1}}) {
    SCOPED_TRACE(seed);
    Dice draw(static_cast<std::uint64_t>(seed));
    MotionRecord record = decay.record(1e-5, jitter, draw);
    if (missing > 0) {
      for (double& y : record.output.reshaped()) {
        if (draw.uniform(0, 1) < missing) y = kNan;
      }
      record.output.block(0, 300, 1, 60).setConstant(kNan);
    }
    decay.expect_in(identify_decays({record}), 3.5);
  }
}

/// Records of one posture share their shapes; a noisy one counts less.
TEST(IdentifyDecays, TakesRecordsTogetherAndANoisyOneForLess) {
  const KnownDecay decay;
  for (const auto& [noise, gain] : {std::pair(1e-5, 0.9), {1e-3, 1.2}}) {
    SCOPED_TRACE(noise);
    Dice draw(14);
    const MotionRecord one = decay.record(1e-5, 0, draw), two = decay.record(noise, 0, draw, 1);
    const Identification alone = identify_decays({one}), both = identify_decays({one, two});
    decay.expect_in(both, 3.5);
    EXPECT_LT(both.modes[0].natural_frequency_std, gain * alone.modes[0].natural_frequency_std);
  }
}

/// A single record does not show what is not linear in it; two do.
TEST(IdentifyDecays, IsLessSureOfOneRecordThanItsLikelihood) {
  const KnownDecay decay;
  Dice draw(21);
  const MotionRecord one = decay.record(1e-5, 0, draw);
  const double alone = identify_decays({one}).modes[0].natural_frequency_std,
               both = identify_decays({one, one}).modes[0].natural_frequency_std;
  EXPECT_NEAR(alone / both, 1.4 * std::sqrt(2), 0.1);
}

/// A hundredth of the samples is off by far: more is left over than the others' noise.
TEST(IdentifyDecays, IsLessSureWhereMoreIsLeftOverThanTheSensorsNoise) {
  const KnownDecay decay;
  Dice draw(16);
  const MotionRecord good = decay.record(1e-5, 0, draw);
  MotionRecord bad = good;
  for (Eigen::Index i = 50; i < bad.output.cols(); i += 100) {
    bad.output.col(i) += 5e-4 * VectorXd{{draw.normal(), draw.normal()}};
  }
  const Identification clean = identify_decays({good, good}), off = identify_decays({bad, bad});
  const double left = (off.noise.array() / clean.noise.array()).maxCoeff();
  EXPECT_GT(left, 3);
  EXPECT_GT(off.modes[0].natural_frequency_std / clean.modes[0].natural_frequency_std,
            0.8 * std::pow(left, 1.5));
}

/// Twelve bits of an encoder's turn: a motion of some steps shows its lightly damped modes.
TEST(IdentifyDecays, FindsModesInAFewStepsOfAnEncoder) {
  constexpr double kStep = 2 * std::numbers::pi / 4096;
  const KnownDecay decay;
  Dice draw(17);
  MotionRecord record = decay.record(0, 0, draw);
  record.output.colwise() -= VectorXd(record.output.rightCols(1));
  record.output *= 15 * kStep / record.output.cwiseAbs().maxCoeff();
  record.output = kStep * (record.output / kStep).array().round();
  const std::vector<FreeDecay> parts = find_decays(record);
  ASSERT_FALSE(parts.empty());
  EXPECT_EQ(parts[0].reason, "");
  const Identification found = identify_decays({record});
  ASSERT_GE(found.modes.size(), 1u);
  EXPECT_NEAR(found.modes[0].natural_frequency, decay.w1,
              3.5 * found.modes[0].natural_frequency_std);
  EXPECT_LT(found.modes[0].natural_frequency_std, 0.02 * decay.w1);
}

TEST(DecayScales, AreFoundOfEachRecordBesideTheStrongest) {
  constexpr double w = 9, z = 0.12;
  const std::vector<std::array<double, 2>> scale{{0.5, 0}, {1, 0}, {0.25, 0.3}};  // of x, x' / w
  std::vector<MotionRecord> records;
  for (const auto& [alpha, beta] : scale) {
    MotionRecord record{VectorXd(400), MatrixXd(2, 400)};
    for (Index i = 0; i < 400; ++i) {
      const double t = record.time[i] = 0.005 * static_cast<double>(i), d = std::sqrt(1 - z * z);
      const double c = std::exp(-z * w * t) * std::cos(w * d * t),
                   s = std::exp(-z * w * t) * std::sin(w * d * t);
      const double motion = alpha * c + beta * (-z * c - d * s);
      record.output.col(i) << 0.3 + 0.02 * motion, -1 - 0.01 * motion;
    }
    records.push_back(std::move(record));
  }
  std::vector<DecayFactor> factors{DecayFactor::of_pair({-z * w, w * std::sqrt(1 - z * z)})};
  find_scales(DecayData(records), VectorXd::Constant(2, 1e-5), factors);
  ASSERT_EQ(factors[0].scale.size(), 3U);
  EXPECT_EQ(factors[0].reference, 1U);
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t k : {0U, 1U}) EXPECT_NEAR(factors[0].scale[r][k], scale[r][k], 1e-9) << r;
  }
}

TEST(IdentifyDecays, FindsAnOverdampedModeByItsTwoDecays) {
  Dice draw(16);
  MotionRecord record{VectorXd(1500), MatrixXd(2, 1500)};
  for (int i = 0; i < 1500; ++i) {
    const double t = 0.001 * i;
    record.time[i] = t;
    const double x = 0.02 * std::exp(-4 * t) - 0.01 * std::exp(-16 * t);
    record.output(0, i) = x + 1e-6 * draw.normal();
    record.output(1, i) = -2 * x + 1e-6 * draw.normal();
  }
  const Identification found = identify_decays({record});
  ASSERT_EQ(found.modes.size(), 1U);
  EXPECT_NEAR(found.modes[0].natural_frequency, 8, 0.01);
  EXPECT_NEAR(found.modes[0].damping_ratio, 1.25, 0.002);
}

TEST(IdentifyDecays, RejectsSumsOfEigenvaluesAsNoModes) {
  Dice draw(17);
  const KnownDecay decay;
  MotionRecord record = decay.record(1e-6, 0, draw);
  for (Index i = 0; i < record.time.size(); ++i) {
    const double x = (record.output(0, i) - 0.3) / 0.02;
    record.output(0, i) += 2e-4 * x * x;  // as geometry does it
  }
  const Identification found = identify_decays({record});
  EXPECT_EQ(found.modes.size(), 2U);
  int sums = 0;
  for (const MeasuredMode& mode : found.rejected) {
    sums += mode.reason.find("sum of two eigenvalues") != std::string::npos;
  }
  EXPECT_GE(sums, 1);
}

TEST(IdentifyDecays, TellsProductsOfStrongMotionsFromModes) {
  Dice draw(18);
  const KnownDecay decay;
  std::vector<MotionRecord> records = {decay.record(1e-6, 0, draw), decay.record(1e-6, 0, draw, 1)};
  records[1].output.row(0).array() -= 0.3;  // half as large
  records[1].output.row(1).array() += 1;
  records[1].output /= 2;
  records[1].output.row(0).array() += 0.3;
  records[1].output.row(1).array() -= 1;
  for (MotionRecord& record : records) {
    for (auto output : record.output.colwise()) {
      const double a = output[0] - 0.3, b = output[1] + 1;
      const double x = (2 * a + b) / 0.05, y = (a - 2 * b) / 0.05;  // about one at first
      output[0] += 1e-4 * (x * x + y * y) + 2e-4 * x * y;
      output[1] += 1e-4 * x * x - 2e-4 * y * y + 1e-4 * x * y;
    }
  }
  const Identification found = identify_decays(records);
  decay.expect_in(found, 3.5);
  EXPECT_EQ(found.order, 4);
  EXPECT_TRUE(found.rejected.empty());
  EXPECT_LT(found.noise.maxCoeff(), 1.5e-6);
  // The records differ in length, and samples are missing in one channel.
  records[1] = part_of(records[1], 0, 800);
  for (Index i = 0; i < records[0].time.size(); i += 7) {
    records[0].output(1, i) = std::numeric_limits<double>::quiet_NaN();
  }
  decay.expect_in(identify_decays(records), 3.5);
}

/// Three releases of each arm, the last one in torques of twelve bits.
TEST(IdentifyDecays, FindsTheModesOfArms) {
  DASHPOT_SKIP_IF_QUICK();
  constexpr int kSamples = 750;
  constexpr double kSampling = 0.002;
  for (const std::size_t which : {1U, 2U, 0U}) {
    Dice draw(20 + which);
    const SprungArm arm(which, draw, 0.05, 0.4);
    std::vector<MotionRecord> records;
    for (int r = 0; r < 3; ++r) {
      VectorXd start(arm.system.mass.rows());
      for (double& q : start) q = 0.02 * draw.normal();
      if (which > 0) {
        records.push_back(sensed(arm, start, kSamples, kSampling, {}, draw));
        continue;
      }
      VectorXd limits = VectorXd::Constant(start.size(), 87);  // N m
      limits.tail(3).setConstant(12);
      testing::Sensors bits;
      bits.noise = 0;
      bits.resolution = 1.0 / 2048;  // of the limits
      const MatrixXd torque = arm.system.stiffness * arm.release(start, kSamples, kSampling);
      records.push_back(sensed(limits.cwiseInverse().asDiagonal() * torque, kSampling, bits, draw));
    }
    const Identification found = identify_decays(records);
    for (const Mode<>& mode : arm.modes) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const MeasuredMode& one : found.modes) {
        nearest = std::min(nearest, std::abs(one.eigenvalues[0] - mode.eigenvalues[0]));
      }
      EXPECT_LT(nearest, 0.005 * mode.natural_frequency)
          << testing::arms()[which].file << ", " << mode.natural_frequency << " rad/s, seed "
          << 20 + which;
    }
    EXPECT_EQ(found.modes.size(), arm.modes.size());
  }
}

TEST(IdentifyDecays, RefusesWhatIsNoRecord) {
  Dice draw(18);
  const MotionRecord good = KnownDecay().record(1e-5, 0, draw);
  const auto expect_refused = [](const std::vector<MotionRecord>& records, const char* reason) {
    const auto said = testing::refusal<std::invalid_argument>([&] { identify_decays(records); });
    EXPECT_THAT(said, ::testing::AllOf(HasSubstr(reason), ::testing::Ne("accepted")));
  };
  const auto changed = [&good](auto change) {
    MotionRecord bad = good;
    change(bad);
    return bad;
  };
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  expect_refused({}, "no record");
  expect_refused({good, changed([](auto& bad) { bad.time[7] = bad.time[6]; })},
                 "record 2: time does not rise");
  expect_refused({changed([](auto& bad) { bad.output.row(1).setConstant(kInfinite - kInfinite); })},
                 "channel 2 has 0 samples");
  expect_refused({changed([](auto& bad) { bad.output(0, 5) = kInfinite; })}, "infinite");
  expect_refused({part_of(good, 0, 19)}, "19 samples");
  expect_refused(
      {good, changed([](auto& bad) { bad.output.conservativeResize(1, Eigen::NoChange); })},
      "as many channels");
  expect_refused({changed([](auto& bad) { bad.output.setConstant(0.5); })}, "");
}

/// Rest, a push of 40 ms, a decay, rest, a step and its decay, at two places.
MotionRecord pushed(const KnownDecay& decay, Dice& draw) {
  constexpr double kStep = 0.002;
  constexpr int kSamples = 4000;
  MotionRecord record{VectorXd(kSamples), MatrixXd::Zero(2, kSamples)};
  std::array<double, 2> x{}, v{};
  for (int i = 0; i < kSamples; ++i) {
    const double t = i * kStep;
    record.time[i] = t;
    const double force = t >= 1 && t < 1.04 ? 10 : 0, goal = t >= 5 ? 0.02 : 0;
    const std::array<double, 2> w{decay.w1, decay.w2}, z{decay.z1, decay.z2};
    for (int part = 0; part < 50; ++part) {
      for (std::size_t k = 0; k < 2; ++k) {
        const double a =
            (k == 0 ? force : -force) - 2 * z[k] * w[k] * v[k] - w[k] * w[k] * (x[k] - goal);
        v[k] += kStep / 50 * a;
        x[k] += kStep / 50 * v[k];
      }
    }
    record.output(0, i) = x[0] + 0.5 * x[1] + 1e-5 * draw.normal();
    record.output(1, i) = 0.5 * x[0] - x[1] + 1e-5 * draw.normal();
  }
  return record;
}

/// Three pushes 100 times the noise, at any rate of sampling.
TEST(FindDecays, FindsEachPushWhateverTheRate) {
  for (const double rate : {125.0, 250.0, 500.0, 1000.0}) {
    Dice draw(31);
    const auto samples = static_cast<Index>(12 * rate);
    MotionRecord record{VectorXd(samples), MatrixXd(2, samples)};
    for (Index i = 0; i < samples; ++i) {
      const double t = record.time[i] = static_cast<double>(i) / rate;
      const double since = std::fmod(t + 3, 4) - 0.01;  // pushes at 1, 5 and 9 s
      const double grown = t < 1 ? 0 : std::min(1.0, since / 0.05);
      const double fast = std::exp(-1.5 * since) * std::sin(30 * since);
      const double slow = std::exp(-1.2 * since) * std::sin(12 * since);
      record.output(0, i) = 0.02 * grown * slow + 0.004 * grown * fast + 2e-4 * draw.normal();
      record.output(1, i) = 0.01 * grown * slow - 0.01 * grown * fast + 2e-4 * draw.normal();
    }
    const std::vector<FreeDecay> found = find_decays(record);
    ASSERT_EQ(found.size(), 3U) << rate;
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(found[k].reason, "");
      EXPECT_NEAR(record.time[found[k].from], 1 + 4 * static_cast<double>(k), 0.2) << rate;
    }
  }
}

TEST(FindDecays, BeginsAfterThePushAndAtTheStep) {
  Dice draw(30);
  const KnownDecay decay;
  const MotionRecord record = pushed(decay, draw);
  const std::vector<FreeDecay> found = find_decays(record);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].reason, "");
  EXPECT_GE(record.time[found[0].from], 1.03);
  EXPECT_LT(record.time[found[0].from], 1.3);
  EXPECT_GE(record.time[found[1].from], 4.996);
  EXPECT_LT(record.time[found[1].from], 5.3);
  std::vector<MotionRecord> records;
  for (const FreeDecay& one : found) records.push_back(part_of(record, one.from, one.to));
  const Identification modes = identify_decays(records);
  ASSERT_EQ(modes.modes.size(), 2U);
  EXPECT_NEAR(modes.modes[0].natural_frequency, decay.w1, 0.005 * decay.w1);
  EXPECT_NEAR(modes.modes[1].damping_ratio, decay.z2, 0.01);
  // And keeps to the samples that are given as free.
  std::vector<bool> free(static_cast<std::size_t>(record.time.size()), true);
  for (Index i = 0; i < record.time.size(); ++i) {
    free[static_cast<std::size_t>(i)] = record.time[i] < 4.9 || record.time[i] > 5.4;
  }
  const std::vector<FreeDecay> later = find_decays(record, free);
  ASSERT_EQ(later.size(), 2U);
  EXPECT_GE(record.time[later[1].from], 5.4);
}

TEST(DecayFit, DoesNotDetermineWhatMovesNothing) {
  Dice draw(33);
  const KnownDecay decay;
  const DecayData data({decay.record(1e-5, 0, draw)});
  std::vector<DecayFactor> factors;
  for (const auto& [w, z] : {std::array{decay.w1, decay.z1}, std::array{decay.w2, decay.z2}}) {
    factors.push_back(DecayFactor::of_pair(w * Complex(-z, std::sqrt(1 - z * z))));
  }
  const VectorXd noise = VectorXd::Constant(2, 1e-5);
  const DecayFit fit = fit_decays(data, factors, noise, 20);
  // Lost before the second sample, but for a derivative whose square underflows.
  factors.push_back(DecayFactor::of_single(-2e5));
  const DecayFit more = fit_decays(data, factors, noise, 20);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(more.covariance(i, i), fit.covariance(i, i), 0.2 * fit.covariance(i, i)) << i;
  }
  EXPECT_FALSE(more.covariance(4, 4) < 1e10);
}

/// Deviations are the fit's plus, in squares, the distance to the same mode of the next larger
/// model.
TEST(IdentifyDecays, DeviationsHoldWhatALargerModelThinks) {
  int compared = 0;
  for (const std::uint64_t seed : {41u, 42u, 43u}) {
    Dice draw(seed);
    const std::vector<MotionRecord> records = {KnownDecay().record(3e-5, 0, draw)};
    const FoundModel search = find_model(records, {});
    const Identification found = identify_decays(records);
    if (!search.larger) continue;
    Index at = 0;
    for (const DecayFactor& factor : search.fit.factors) {
      ASSERT_TRUE(factor.pair);
      const double w = std::exp(factor.first), ratio = factor.second;
      const auto same = [&](const double frequency) { return std::abs(frequency / w - 1) < 0.1; };
      for (const MeasuredMode& mode : found.modes) {
        if (!same(mode.natural_frequency)) continue;
        for (const DecayFactor& other : search.larger->factors) {
          if (!other.pair || !same(std::exp(other.first))) continue;
          const double dw = std::exp(other.first) - w, dz = other.second - ratio;
          const MatrixXd& V = search.fit.covariance;
          EXPECT_NEAR(mode.natural_frequency_std, std::hypot(w * std::sqrt(V(at, at)), dw),
                      1e-6 * mode.natural_frequency_std);
          EXPECT_NEAR(mode.damping_ratio_std, std::hypot(std::sqrt(V(at + 1, at + 1)), dz),
                      1e-6 * mode.damping_ratio_std);
          EXPECT_NEAR(mode.covariance, w * V(at, at + 1) + dw * dz,
                      1e-6 * mode.natural_frequency_std * mode.damping_ratio_std);
          EXPECT_GT(std::abs(dw), 1e-3 * mode.natural_frequency_std);
          ++compared;
        }
      }
      at += factor.parameters();
    }
  }
  EXPECT_GE(compared, 2);
}

/// The search of two arms gets lost among factors that cancel each other.
TEST(IdentifyDecays, FindsMostModesWhereASearchGotLost) {
  std::size_t found = 0;
  for (const int number : {56, 61}) {
    Dice draw(1'000'003 + static_cast<std::uint64_t>(number));
    const SprungArm arm(static_cast<std::size_t>(number), draw, 0.05, 0.9);
    VectorXd start(arm.system.mass.rows());
    for (double& q : start) q = 0.02 * draw.normal();
    const Identification result = identify_decays({sensed(arm, start, 1500, 0.001, {}, draw)});
    for (const MeasuredMode& mode : result.modes) {
      const bool known = std::any_of(arm.modes.begin(), arm.modes.end(), [&](const Mode<>& truth) {
        return std::abs(mode.natural_frequency / truth.natural_frequency - 1) < 0.1;
      });
      if (known) ++found;
    }
  }
  EXPECT_GE(found, 12u);  // of 14
}

/// After fast motion there is slow motion whose speed, but not whose size, is lost in noise; digits
/// that rest do not mean less noise.
TEST(FindDecays, GoesOnWhereSlowMotionOutlastsFastMotion) {
  for (const double digit : {0.0, 1e-4}) {
    Dice draw(34);
    MotionRecord record{VectorXd::LinSpaced(4000, 0, 3.999), MatrixXd(2, 4000)};
    for (Index i = 0; i < 4000; ++i) {
      const double t = record.time[i];
      const double fast = 0.02 * std::exp(-12 * t) * std::cos(40 * t);
      const double slow = 2e-3 * std::exp(-1.8 * t) * std::cos(5.7 * t);
      record.output(0, i) = fast + slow + 1e-5 * draw.normal();
      record.output(1, i) = fast - 0.5 * slow + 1e-5 * draw.normal();
    }
    if (digit > 0) record.output = (record.output / digit).array().round() * digit;
    const std::vector<FreeDecay> found = find_decays(record);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_LT(record.time[found[0].from], 0.1) << digit;
    EXPECT_GT(record.time[found[0].to - 1], 1.5) << digit;
  }
}

TEST(FindDecays, FindsNothingInRest) {
  Dice draw(32);
  MotionRecord record{VectorXd::LinSpaced(3000, 0, 3), MatrixXd(2, 3000)};
  for (double& y : record.output.reshaped()) y = 1e-5 * draw.normal();
  for (const FreeDecay& decay : find_decays(record)) EXPECT_NE(decay.reason, "");
}

}  // namespace
}  // namespace dashpot::identification
