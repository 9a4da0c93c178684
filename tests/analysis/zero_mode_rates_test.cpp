// The rates at which velocities along zero modes decay lie within their bounds.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <algorithm>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::Random;

/// Springs and dampers in all directions but `zeros`, as J' (K_C J + C_C dJ/dt) and J' C_C J are,
/// and `rate` along all motions.
System<> moving_springs(Random& random, int n, int zeros, double damping, double rate) {
  System<> system(n);
  const MatrixXd J = random.matrix(n - zeros, n), J_rate = random.matrix(n - zeros, n);
  system.mass = random.spd(n);
  system.damping = damping * J.transpose() * J + rate * system.mass;
  system.stiffness = J.transpose() * (400 * random.spd(n - zeros) * J + damping * J_rate);
  return system;
}

/// Without symmetry the dampers deform the motions that decay at the rate, and other decays are
/// near it. Where no damping acts the bound is the root of rounding errors of the stiffness.
TEST(ZeroModeRates, AreFoundWithoutSymmetryBesideStrongDampingAndOverdampedDecays) {
  Random random(2203);
  struct Case {
    double rate, least_damping, most_damping, bound;
  };
  for (const auto& [rate, least, most, bound] :
       {Case{0, 5, 100, 1e-3}, Case{0.4, 5, 5, 1e-6}, Case{0.01, 20, 60, 1e-5},
        Case{0.4, 20, 60, 4e-4}, Case{10, 20, 60, 1e-2}, Case{300, 20, 60, 0.3}}) {
    for (int trial = 0; trial < 100; ++trial) {
      SCOPED_TRACE(::testing::Message() << "rate " << rate << ", trial " << trial);
      const int n = random.integer(3, 7), zeros = random.integer(1, std::min(3, n - 1));
      const System<> system =
          moving_springs(random, n, zeros, random.log_uniform(least, most), rate);
      const Spectrum<> spectrum = analyze(system);
      ASSERT_EQ(spectrum.status, Status::kOk);
      ASSERT_EQ(spectrum.zero_modes.count, zeros);
      ASSERT_EQ(spectrum.modes.size(), n - zeros);
      for (int i = 0; i < zeros; ++i) {
        EXPECT_LE(std::abs(spectrum.zero_mode_rates[i] + rate), spectrum.zero_mode_rates_bound[i]);
        EXPECT_LE(spectrum.zero_mode_rates_bound[i], bound);
      }
      if (least > 5 || (rate > 0 && most > 5)) continue;
      for (const Mode<>& mode : spectrum.modes) EXPECT_LE(mode.error_bound, 1e-7);
    }
  }
}

/// Relative distance of the first rate from the nearest real eigenvalue of a mode.
double distance_to_decays(const Spectrum<>& spectrum) {
  const double rate = spectrum.zero_mode_rates[0];
  double nearest = testing::kInfinity;
  for (const Mode<>& mode : spectrum.modes) {
    for (const Complex& value : mode.eigenvalues) {
      if (value.imag() == 0) nearest = std::min(nearest, std::abs(value.real() - rate));
    }
  }
  return nearest / std::abs(rate);
}

/// A damper couples the momentum along which no spring acts to the modes: rate and decay share
/// their vectors nearly, and only together are they known well.
TEST(ZeroModeRates, ThatMeetADecayKeepTheirBounds) {
  Random random(2206);
  int met = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = random.integer(3, 5);
    System<> system = moving_springs(random, n, 1, random.log_uniform(1, 30), 0);
    MatrixXd dampers = system.damping;
    dampers(0, 0) += dampers.norm() / n;
    const auto scaled = [&](double factor) {
      system.damping = factor * dampers;
      return analyze(system);
    };
    double nearest = testing::kInfinity, factor = 1;
    const auto look_at = [&](double candidate) {
      const double distance = distance_to_decays(scaled(candidate));
      if (distance < nearest) nearest = distance, factor = candidate;
    };
    for (double candidate = 0.5; candidate < 8; candidate *= 1.1) look_at(candidate);
    for (double step = 0.05; step > 1e-6; step /= 2) {
      const double middle = factor;
      look_at(middle * (1 - step));
      look_at(middle * (1 + step));
    }
    if (nearest > 0.01) continue;
    ++met;
    const Spectrum<> spectrum = scaled(factor);
    EXPECT_EQ(spectrum.status, Status::kOk) << "trial " << trial;
    EXPECT_LE(spectrum.zero_mode_rates_bound[0], 1e-6) << "trial " << trial << ": " << nearest;
  }
  EXPECT_GT(met, 10);
}

TEST(ZeroModeRates, ThatAreZeroAreFoundWhateverDampersDoToOthers) {
  for (const double damping : {1.0, 5.0, 10.0, 100.0}) {
    System<> pair(2);  // lambda^2 (lambda^2 + 18 - damping^2) = 0
    pair.stiffness << 9, -9, -9, 9;
    pair.damping.diagonal() << damping, -damping;
    const Spectrum<> spectrum = analyze(pair);
    ASSERT_EQ(spectrum.status, Status::kOk) << damping;
    EXPECT_LE(std::abs(spectrum.zero_mode_rates[0]), spectrum.zero_mode_rates_bound[0]) << damping;
    EXPECT_LE(spectrum.zero_mode_rates_bound[0], 1e-5) << damping;
  }
  // Dampers leave the zero mode x alone, but not the momentum y' x' along which no spring acts.
  Random random(2205);
  for (int trial = 0; trial < 300; ++trial) {
    const int n = random.integer(2, 6);
    const Eigen::VectorXd x = random.matrix(n, 1).normalized(),
                          y = random.matrix(n, 1).normalized();
    if (std::abs(x.dot(y)) < 0.1) continue;
    const MatrixXd others = MatrixXd::Identity(n, n) - x * y.transpose() / x.dot(y);
    System<> system(n);
    system.stiffness = 100 * others;
    system.damping = random.log_uniform(1, 1000) * others.transpose() * others;
    const Spectrum<> spectrum = analyze(system);
    ASSERT_EQ(spectrum.status, Status::kOk) << "trial " << trial;
    ASSERT_EQ(spectrum.modes.size(), n - 1) << "trial " << trial;
    EXPECT_LE(std::abs(spectrum.zero_mode_rates[0]), spectrum.zero_mode_rates_bound[0])
        << "trial " << trial;
  }
}

TEST(ZeroModeRates, CountWhatTheStiffnessLacks) {
  // k instead of 0 makes -a of the rate -a +- sqrt(a^2 - 4 k)) / 2, or a frequency where a = 0.
  for (const double a : {0.0, 1e-3, 1.0}) {
    System<> joint(1);
    joint.damping(0, 0) = a;
    joint.stiffness_error = MatrixXd::Constant(1, 1, 1e-10);
    const Spectrum<> spectrum = analyze(joint);
    ASSERT_EQ(spectrum.zero_modes.count, 1);
    const std::complex<double> root = std::sqrt(std::complex<double>(a * a / 4 - 1e-10));
    EXPECT_LE(std::abs(-a / 2 - root - spectrum.zero_mode_rates[0]),
              spectrum.zero_mode_rates_bound[0])
        << a;
    EXPECT_LE(spectrum.zero_mode_rates_bound[0], a == 0 ? 1e-4 : 1e-8 / a) << a;
  }
}

TEST(ZeroModeRates, ThatAreNotRealHaveNoBound) {
  System<> system(2);
  system.damping << 1, 1, -1, 1;
  const Spectrum<> spectrum = analyze(system);
  for (const double bound : spectrum.zero_mode_rates_bound) EXPECT_EQ(bound, testing::kInfinity);
}

}  // namespace
}  // namespace dashpot::analysis
