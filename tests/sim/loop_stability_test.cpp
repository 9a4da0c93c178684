// The stability that the analysis of the sampled loop promises, against plants in simulation: gains
// 2 % inside the boundary settle, 2 % outside they do not. ring_down_test.cpp has the modes of
// arms.
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/linear_system.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace dashpot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::plant_options;
using testing::Random;

/// Growth of a size from the first to the last tenth of the ticks.
template <class Step>
double growth(int ticks, const Step& step) {
  double first = 0, last = 0;
  for (int k = 0; k < ticks; ++k) {
    const double size = step();
    if (k < ticks / 10) first = std::max(first, size);
    if (k >= ticks - ticks / 10) last = std::max(last, size);
  }
  return last / first;
}

/// Ticks in which |z| or its inverse grows to e^9, and those before the largest |z| rules.
int ticks_to_tell(double spectral_radius) {
  return 200 + static_cast<int>(9 / std::abs(std::log(spectral_radius)));
}

TEST(LoopStability, TurnsWhereTheAnalysisSays) {
  DASHPOT_SKIP_IF_QUICK();
  int compared = 0;
  for (std::uint64_t seed = 15; seed <= 24; ++seed) {
    Random random(seed);
    const int n = random.integer(1, 5);
    analysis::System<> nominal(n);
    nominal.mass = random.spd(n);
    nominal.stiffness = 1000 * random.spd(n);
    nominal.damping = 20 * random.spd(n);
    analysis::SampledLoop loop;
    loop.period = random.log_uniform(5e-4, 4e-3);
    loop.delay = seed == 24 ? 60 : static_cast<int>(seed % 4);
    loop.torque_cutoff = random.integer(0, 1) * random.log_uniform(0.05, 0.3) / loop.period;
    loop.difference_velocity = random.integer(0, 1) == 1;
    loop.friction = 0.5 * random.spd(n);
    nominal.damping += loop.friction;
    const MatrixXd passive = random.integer(0, 1) * 500 * random.spd(n);  // springs of the world
    loop.passive_stiffness = passive;
    nominal.stiffness += passive;
    const double margin = gain_margin(nominal, analyze(nominal), loop);
    ASSERT_GT(margin, 0);
    ASSERT_TRUE(std::isfinite(margin));
    for (const double factor : {0.98, 1.02}) {
      analysis::System<> system = nominal;
      system.stiffness = passive + factor * margin * (nominal.stiffness - passive);
      system.damping = loop.friction + factor * margin * (nominal.damping - loop.friction);
      const analysis::SampledSpectrum sampled = sample_loop(system, analyze(system), loop);
      EXPECT_EQ(sampled.stable(), factor < 1);
      testing::LinearSystem masses(system.mass, loop.friction, passive);
      sim::Plant plant(masses, plant_options(loop), random.vector(n));
      const MatrixXd K = system.stiffness - passive, C = system.damping - loop.friction;
      const double grown = growth(ticks_to_tell(sampled.spectral_radius), [&] {
        const sim::Measurement& seen = plant.measured();
        EXPECT_EQ(plant.step(-K * seen.position - C * seen.velocity), sim::Status::kOk);
        return plant.position().norm();
      });
      if (factor < 1) {
        EXPECT_LT(grown, 0.1) << "margin " << margin << ", |z| " << sampled.spectral_radius;
      } else {
        EXPECT_GT(grown, 10) << "margin " << margin << ", |z| " << sampled.spectral_radius;
      }
      ++compared;
    }
  }
  EXPECT_EQ(compared, 20);
}

}  // namespace
}  // namespace dashpot
