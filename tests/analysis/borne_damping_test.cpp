// The damping that a mode tolerates, beside gain margins from eigenvalues of the loop, and beside
// the search of the design at set-up time.
#include <dashpot/analysis/borne_damping.hpp>
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/analysis/design/level_search.hpp>
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random_impedance.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

using testing::Random;

SampledLoop random_loop(Random& random) {
  SampledLoop loop;
  loop.period = random.log_uniform(2e-4, 5e-3);
  loop.delay = random.integer(0, 4);
  if (random.integer(0, 1) == 1) loop.torque_cutoff = random.log_uniform(0.005, 0.5) / loop.period;
  loop.difference_velocity = random.integer(0, 1) == 1;
  return loop;
}

/// Returns the gain margin of y'' + d y' + omega^2 y = 0.
double margin_of(double omega, double d, const SampledLoop& loop) {
  System<> system(1);
  system.mass(0, 0) = 1;
  system.damping(0, 0) = d;
  system.stiffness(0, 0) = omega * omega;
  return gain_margin(system, analyze(system), loop, 1e3);
}

/// A mode, and what a loop leaves of its damping.
struct Case {
  explicit Case(Random& random)
      : loop(random_loop(random)), margin(random.uniform(1.1, 3)), borne(loop, margin) {
    const double lag = loop.delay + 0.5 +
                       (loop.torque_cutoff > 0
                            ? 1 / std::expm1(2 * std::acos(-1) * loop.torque_cutoff * loop.period)
                            : 0) +
                       (loop.difference_velocity ? 0.5 : 0);
    omega = random.log_uniform(0.03, 1.2) / lag / loop.period;
    wanted = 2 * random.log_uniform(0.05, 4) * omega;
    share = borne.share(omega, wanted, 1, level);
  }
  double at(double part) const { return margin_of(omega, part * wanted, loop); }

  SampledLoop loop;
  double margin;
  BorneDamping borne;
  double omega, wanted, share;
  DampingLevel level;
};

TEST(BorneDamping, LeavesEachModeItsMargin) {
  Random random(4101);
  int whole = 0, lowered = 0, hopeless = 0;
  for (int k = 0; k < 400; ++k) {
    const Case mode(random);
    SCOPED_TRACE(k);
    ASSERT_GT(mode.share, 0);
    ASSERT_LE(mode.share, 1);
    EXPECT_EQ(mode.level.level, mode.share);
    const double found = mode.at(mode.share);
    if (mode.level.kept) {
      EXPECT_GE(found, mode.margin * (1 - 1e-6));
      ++(mode.share == 1 ? whole : lowered);
      if (mode.share < 0.95) {
        EXPECT_LT(mode.at(1.05 * mode.share), mode.margin);
      }
      continue;
    }
    ++hopeless;
    EXPECT_LT(found, mode.margin * 1.03);
    for (double part = 0.1; part <= 1; part += 0.1) EXPECT_LE(mode.at(part), found * (1 + 1e-5));
  }
  EXPECT_GT(whole, 100);
  EXPECT_GT(lowered, 30);
  EXPECT_GT(hopeless, 100);
}

/// No jumps where the share leaves 1, between points of the table, or where nothing keeps the
/// margin.
TEST(BorneDamping, IsContinuous) {
  Random random(4102);
  for (int k = 0; k < 50; ++k) {
    const Case mode(random);
    const double fastest = 3 * mode.omega, step = 1e-5 * fastest;
    DampingLevel level;
    double last = 0;
    for (double omega = 0; omega < fastest; omega += step) {
      const double wanted = mode.wanted / mode.omega * omega;
      const double d = wanted > 0 ? wanted * mode.borne.share(omega, wanted, 1, level) : 0;
      ASSERT_LE(std::abs(d - last), 1e-3 * mode.wanted) << omega;
      last = d;
    }
  }
}

/// Partly active springs tolerate the same part of the damping, so that parts of several springs
/// that add up to one tolerate no more than one. Without springs any damping keeps the margin.
TEST(BorneDamping, GivesAPartOfTheSpringsItsPart) {
  Random random(4103);
  for (int k = 0; k < 100; ++k) {
    const Case mode(random);
    const double part = random.uniform(0.01, 1);
    DampingLevel level;
    EXPECT_NEAR(mode.borne.share(std::sqrt(part) * mode.omega, part * mode.wanted, part, level),
                mode.share, 1e-9 * mode.share);
    EXPECT_EQ(level.kept, mode.level.kept);
    DampingLevel still;
    EXPECT_EQ(mode.borne.share(0, 0, 1, still), 1);
    EXPECT_TRUE(still.kept);
  }
}

TEST(BorneDamping, BearsAnythingWithoutALoop) {
  DampingLevel level;
  EXPECT_EQ(BorneDamping().share(1e5, 1e6, 1, level), 1);
  EXPECT_EQ(level.level, 1);
  EXPECT_TRUE(level.kept);
}

TEST(BorneDamping, RefusesWhatIsNoLoop) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double margin : {1.0, 0.0, nan}) {
    EXPECT_THROW(BorneDamping({}, margin), std::invalid_argument);
  }
  for (const SampledLoop& loop :
       {SampledLoop{.period = 0}, SampledLoop{.delay = -1}, SampledLoop{.torque_cutoff = nan}}) {
    EXPECT_THROW(BorneDamping(loop, 2), std::invalid_argument);
  }
}

/// The level of the design at set-up time lowers all modes to the level that the worst mode
/// tolerates.
TEST(BorneDamping, AgreesWithTheSearchOfTheDesign) {
  Random random(4104);
  int lowered = 0;
  for (int k = 0; k < 120; ++k) {
    TaskImpedance impedance = testing::random_impedance(random, 6, 6);
    impedance.task_damping.reset();
    LoopLimit limit{random_loop(random), random.uniform(1.5, 3)};
    const DampingTarget target = DampingTarget::constant(random.uniform(0.5, 2));
    // Modes up to about where springs alone are too much
    const DampingDesign plain = design_damping(impedance, target);
    const double fastest = plain.spectrum.modes[0].natural_frequency;
    const double borne = random.uniform(0.05, 0.3) / (limit.loop.delay + 1) / limit.loop.period;
    *impedance.task_stiffness *= borne * borne / (fastest * fastest);
    const SampledDamping searched = design_damping(impedance, target, limit);
    if (!searched.kept) continue;

    const BorneDamping most(limit.loop, limit.gain_margin);
    RatioDamping damper(target);
    damper.set_loop(&most);
    ASSERT_EQ(damper.set_stiffness(*impedance.task_stiffness), Status::kOk);
    Eigen::MatrixXd C(6, 6);
    ASSERT_EQ(damper.update(impedance.mass, *impedance.jacobian, C), Status::kOk);
    EXPECT_TRUE(damper.level().kept);
    EXPECT_LE(damper.level().level, searched.level * (1 + 1e-4)) << k;
    EXPECT_GE(damper.level().level, searched.level * 0.96) << k;
    lowered += searched.level < 0.99 ? 1 : 0;
    impedance.task_damping = C;
    const System<> system = to_joint_space(impedance);
    EXPECT_GE(gain_margin(system, analyze(system), limit.loop), limit.gain_margin * (1 - 1e-5));
  }
  EXPECT_GT(lowered, 15);
}

// The search for the largest share of damping that a loop tolerates, with functions as margins.

/// A margin that rises to `peak` at `level`, and falls beyond it.
struct Peak {
  double level, peak, rise, fall;  ///< rise and fall: powers of the level

  double margin(double at) const { return peak * std::pow(at / level, at < level ? rise : -fall); }
};

struct Search {
  FoundLevel found;
  int questions = 0, margins = 0;

  Search(const Peak& peak, double wanted) {
    found = find_level(
        [&](double level, double least) {
          ++questions;
          return peak.margin(level) >= least;
        },
        [&](double level) {
          ++margins;
          return peak.margin(level);
        },
        wanted);
  }
};

TEST(LevelSearch, FindsTheLargestLevelFromBelow) {
  for (const double level : {2e-3, 0.01, 0.1, 0.3, 0.66, 0.9}) {
    const Search search({0.5 * level, 4, 1, 1}, 2);  // 2 at `level`
    EXPECT_TRUE(search.found.kept);
    EXPECT_LE(search.found.level, level * (1 + 1e-12));
    EXPECT_GE(search.found.level, level * (1 - 1.1e-6));
    EXPECT_EQ(search.margins, 0);
  }
  EXPECT_EQ(Search({1, 2.1, 1, 1}, 2).found.level, 1);
}

TEST(LevelSearch, FindsAPeakBetweenGridPoints) {
  for (const double level : {0.003, 0.05, 0.8, 0.95}) {
    for (const double rise : {0.5, 4.0}) {
      const Search search({level, 2.0001, rise, 1}, 2);
      EXPECT_TRUE(search.found.kept) << level;
      EXPECT_NEAR(search.found.level, level, 3e-4 * level);
    }
  }
}

TEST(LevelSearch, StaysAtFullDampingWhereNoLevelHasAMargin) {
  const Search search({1, 0, 1, 1}, 2);
  EXPECT_FALSE(search.found.kept);
  EXPECT_EQ(search.found.level, 1);
  EXPECT_EQ(search.margins, 1);
}

/// A margin that is zero but for a part of the levels.
TEST(LevelSearch, FindsALevelThatHasAMarginAtAll) {
  const auto margin = [](double level) { return level > 0.1 && level < 0.7 ? 0.5 : 0.0; };
  const FoundLevel found =
      find_level([&](double level, double least) { return margin(level) >= least; }, margin, 2);
  EXPECT_FALSE(found.kept);
  EXPECT_EQ(margin(found.level), 0.5);
}

TEST(LevelSearch, SpendsLittleOnAMarginOutOfReach) {
  for (const double level : {0.003, 0.007, 0.02, 0.05, 0.13, 0.3, 0.6, 1.0, 5.0}) {
    const Search search({level, 0.7, 4, 1}, 2);
    EXPECT_FALSE(search.found.kept);
    EXPECT_LE(search.questions, 36);  // 17 of the grid
    EXPECT_LE(search.margins, 11);    // of levels each better than those before
    EXPECT_NEAR(std::log(search.found.level), std::log(std::min(level, 1.0)), 3e-3);
  }
}

}  // namespace
}  // namespace dashpot::analysis
