// Decays that last long, and decays with what a hum, friction or a wander adds to them. `./run
// stress identify rubbing` and `stiffening` release arms that rub and arms whose springs stiffen.
#include <dashpot/identification/identification.hpp>
#include <dashpot/identification/motion_verdict.hpp>
#include <dashpot/tests/support/dice.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace dashpot::identification {
namespace {

using Eigen::Index;
using testing::Dice;

struct Oscillator {
  double w, z;
  double damped() const { return w * std::sqrt(1 - z * z); }
  /// From 1 at rest.
  double released(double t) const {
    return std::exp(-z * w * t) *
           (std::cos(damped() * t) + z * w / damped() * std::sin(damped() * t));
  }
};

constexpr std::array<Oscillator, 2> kTwo = {{{9, 0.12}, {31, 0.3}}};

/// Two channels, `step` (s) apart, of two oscillators.
template <typename Motion>
MotionRecord record_of(double duration, double step, double noise, Dice& draw,
                       const Motion& motion) {
  const auto samples = static_cast<Index>(duration / step);
  MotionRecord record{Eigen::VectorXd(samples), Eigen::MatrixXd(2, samples), {}};
  for (Index i = 0; i < samples; ++i) {
    const double t = record.time[i] = step * static_cast<double>(i);
    const double x = motion(kTwo[0], t), y = motion(kTwo[1], t);
    record.output.col(i) << 0.02 * x + 0.01 * y + noise * draw.normal(),
        0.01 * x - 0.02 * y + noise * draw.normal();
  }
  return record;
}

void expect_two(const Identification& found, double within) {
  ASSERT_EQ(found.modes.size(), 2U);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(found.modes[k].natural_frequency, kTwo[k].w, within * kTwo[k].w);
    EXPECT_NEAR(found.modes[k].damping_ratio, kTwo[k].z, within);
    EXPECT_LT(std::abs(found.modes[k].natural_frequency - kTwo[k].w),
              4 * found.modes[k].natural_frequency_std);
  }
}

/// A chain of masses that is struck rings at high frequencies for long.
TEST(DisturbedDecays, FastModesAreThereHoweverLongTheRecord) {
  constexpr std::array<Oscillator, 4> kChain = {
      {{59.4, 0.01}, {162.6, 0.01}, {245.2, 0.0128}, {302.5, 0.0151}}};
  for (const double duration : {2.0, 6.0, 20.0}) {
    Dice draw(51);
    const auto samples = static_cast<Index>(duration / 0.005);
    MotionRecord record{Eigen::VectorXd(samples), Eigen::MatrixXd::Zero(4, samples), {}};
    for (Index i = 0; i < samples; ++i) {
      const double t = record.time[i] = 0.005 * static_cast<double>(i);
      for (std::size_t k = 0; k < 4; ++k) {
        for (Index c = 0; c < 4; ++c) {
          const double shape =
              std::sin(static_cast<double>((2 * k + 1) * static_cast<std::size_t>(c + 1)) *
                       std::numbers::pi / 9);
          record.output(c, i) +=
              shape * std::exp(-kChain[k].z * kChain[k].w * t) * std::sin(kChain[k].damped() * t);
        }
      }
      for (double& y : record.output.col(i)) y += 1e-3 * draw.normal();
    }
    const Identification found = identify_decays({record});
    ASSERT_EQ(found.modes.size(), 4U) << duration;
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(found.modes[k].natural_frequency, kChain[k].w,
                  4 * found.modes[k].natural_frequency_std);
      EXPECT_LT(found.modes[k].natural_frequency_std, 1e-3 * kChain[k].w);
    }
    EXPECT_LT(found.whiteness, 2) << duration;
  }
}

/// A joint that is let go, and what its friction does beside a spring that it balances at
/// `friction`; by small steps of its equation, at random with noise or rounded by an encoder.
struct Joint {
  Oscillator mode{};
  double friction = 0;
  MotionRecord record;

  /// `force(v)` scales the friction, by the speed in units of omega.
  template <typename Force>
  Joint(Dice& draw, double weight, const Force& force, Index samples = 400) {
    mode = {draw.log_uniform(3, 40), draw.log_uniform(0.005, 0.15)};
    friction = weight * draw.log_uniform(0.01, 0.05);
    constexpr Index kSteps = 200;
    const double step = 2 * std::numbers::pi / mode.w / 30, h = step / kSteps;
    const double noise = draw.log_uniform(1e-4, 3e-3), rest = draw.normal();
    const bool rounded = draw.integer(0, 1) == 1;
    record = {Eigen::VectorXd(samples), Eigen::MatrixXd(1, samples), {}};
    double y = 1, v = 0;
    for (Index i = 0; i < samples; ++i) {
      record.time[i] = step * static_cast<double>(i);
      const double seen = rest + y;
      record.output(0, i) =
          rounded ? 3 * noise * std::round(seen / (3 * noise)) : seen + noise * draw.normal();
      for (Index k = 0; k < kSteps; ++k) {
        const double pull = -mode.w * mode.w * y - 2 * mode.z * mode.w * v;
        const double most = mode.w * mode.w * friction * force(v / mode.w);
        const double free = v + h * pull;  // friction at most stops it
        v = std::abs(free) < h * most ? 0 : free - std::copysign(h * most, free);
        y += h * v;
      }
    }
  }
};

TEST(DisturbedDecays, AJointThatRubsHasItsModeAndItsFriction) {
  int found = 0, inside = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Dice draw(400 + seed);
    // Every other joint creeps: its friction fades at small speeds.
    const double slow = seed % 2 == 0 ? 0 : 0.02;
    const Joint joint(draw, 1,
                      [slow](double v) { return slow > 0 ? std::tanh(std::abs(v) / slow) : 1; });
    const auto decays = find_decays(joint.record);
    ASSERT_EQ(decays.size(), 1U) << seed;
    const Identification result =
        identify_decays({part_of(joint.record, decays[0].from, decays[0].to)});
    if (!(result.friction > 0)) continue;
    ++found;
    ASSERT_EQ(result.modes.size(), 1U) << seed;
    const MeasuredMode& mode = result.modes[0];
    EXPECT_NEAR(mode.natural_frequency, joint.mode.w, 2e-3 * joint.mode.w) << seed;
    EXPECT_NEAR(mode.damping_ratio, joint.mode.z, 5e-3) << seed;
    EXPECT_NEAR(result.friction, joint.friction, 0.1 * joint.friction) << seed;
    inside += std::abs(mode.damping_ratio - joint.mode.z) < 1.96 * mode.damping_ratio_std &&
              std::abs(result.friction - joint.friction) < 1.96 * result.friction_std;
  }
  EXPECT_GE(found, 18);
  EXPECT_GE(inside, found - 3);
}

/// Neither in a joint without friction, nor one that is held back by the square of its speed, nor
/// in two modes of one channel.
TEST(DisturbedDecays, NoFrictionIsFoundWhereThereIsNone) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    Dice draw(500 + seed);
    for (const double weight : {0.0, 3.0}) {
      const Joint joint(draw, weight, [](double v) { return v * v; });
      EXPECT_EQ(identify_decays({joint.record}).friction, 0) << seed << ", " << weight;
    }
    MotionRecord two = record_of(3, 0.005, 1e-5, draw, [](const Oscillator& mode, double t) {
      return Oscillator{mode.w, 0.3 * mode.z}.released(t);
    });
    two.output.conservativeResize(1, Eigen::NoChange);
    EXPECT_EQ(identify_decays({two}).friction, 0) << seed;
    EXPECT_EQ(identify_decays({two, part_of(two, 500, 600)}).friction, 0) << seed;
  }
}

TEST(DisturbedDecays, ReleasesOfAJointThatRubsShareModeAndFriction) {
  Dice draw(600);
  const Joint joint(draw, 1, [](double) { return 1.0; });
  MotionRecord other = joint.record;  // later, and about another rest
  other = part_of(other, 7, other.time.size());
  other.output.array() += 0.3;
  const MotionRecord still = part_of(joint.record, 340, 400);  // hardly a turn
  const Identification found = identify_decays({joint.record, other, still});
  ASSERT_EQ(found.modes.size(), 1U);
  EXPECT_NEAR(found.modes[0].natural_frequency, joint.mode.w, 1e-3 * joint.mode.w);
  EXPECT_NEAR(found.friction, joint.friction, 0.05 * joint.friction);
}

TEST(DisturbedDecays, AHumDoesNotHideAJointThatRubs) {
  Dice draw(601);
  Joint joint(
      draw, 1, [](double) { return 1.0; }, 1200);
  for (Index i = 0; i < joint.record.time.size(); ++i) {
    joint.record.output(0, i) += 0.01 * std::sin(0.9 * static_cast<double>(i));
  }
  const Identification found = identify_decays({joint.record});
  ASSERT_EQ(found.modes.size(), 1U);
  EXPECT_NEAR(found.friction, joint.friction, 0.05 * joint.friction);
  ASSERT_EQ(found.rejected.size(), 1U);
  EXPECT_NEAR(found.rejected[0].natural_frequency, 0.9 / joint.record.time[1], 0.1);
}

/// Friction that ends the motion after a turn or two explains it as well as a sum of modes.
TEST(DisturbedDecays, AJointThatHardlyTurnsHasNoFalseModes) {
  int believed = 0;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    Dice draw(700 + seed);
    const Joint joint(draw, 8, [](double) { return 1.0; });
    for (const MeasuredMode& mode : identify_decays({joint.record}).modes) {
      ++believed;
      EXPECT_NEAR(mode.natural_frequency, joint.mode.w, 0.01 * joint.mode.w) << seed;
    }
  }
  EXPECT_GE(believed, 4);
}

TEST(DisturbedDecays, AHumIsTakenAwayAndMakesNoAmbientMotion) {
  for (const double size : {1e-3, 1e-2}) {
    Dice draw(52);
    MotionRecord record = record_of(
        2.3, 0.001, 1e-5, draw, [](const Oscillator& one, double t) { return one.released(t); });
    for (Index i = 0; i < record.time.size(); ++i) {
      record.output.col(i).array() +=
          0.02 * size * std::sin(100 * std::numbers::pi * record.time[i] + 1);
    }
    EXPECT_EQ(judge_motion(record).kind, MotionKind::kDecays) << size;
    const Identification found = identify_decays({record});
    expect_two(found, 2e-3);
    ASSERT_FALSE(found.rejected.empty());
    EXPECT_NEAR(found.rejected.back().natural_frequency, 100 * std::numbers::pi, 0.1);
    EXPECT_EQ(found.rejected.back().reason, "a steady hum, which was removed");
  }
}

/// A light mode beside a wander that no model explains: slow, of two channels for themselves.
TEST(DisturbedDecays, BelieveNoDampedModesWhereMuchIsLeftOver) {
  int found = 0;
  for (const std::uint64_t seed : {4300U, 4301U, 4302U, 4303U, 4348U}) {
    Dice draw(seed);
    MotionRecord record{Eigen::VectorXd(1500), Eigen::MatrixXd(2, 1500)};
    double a = 0, b = 0;
    for (Eigen::Index i = 0; i < 1500; ++i) {
      const double t = record.time[i] = 0.004 * static_cast<double>(i);
      const double mode = std::exp(-0.3 * t) * std::cos(18.6 * t);
      a = 0.985 * a + 0.05 * draw.normal();
      b = 0.97 * b + 0.07 * draw.normal();
      record.output(0, i) = mode + a;
      record.output(1, i) = 0.5 * mode + b;
    }
    const Identification result = identify_decays({record});
    EXPECT_LT(result.explained, 0.95) << seed;
    for (const MeasuredMode& mode : result.modes) {
      EXPECT_LT(mode.damping_ratio, 0.1) << seed << ": " << mode.natural_frequency;
      found += std::abs(mode.natural_frequency - 18.6) < 0.3;
    }
  }
  EXPECT_GE(found, 4);
}

}  // namespace
}  // namespace dashpot::identification
