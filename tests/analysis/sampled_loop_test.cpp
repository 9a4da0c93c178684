// The loop as it really runs, against characteristic equations in closed form.
#include <dashpot/analysis/sampled/sampled_data_model.hpp>
#include <dashpot/analysis/sampled_loop.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_impedance.hpp>
#include <dashpot/tests/support/refusal.hpp>
#include <dashpot/tests/support/sampled_loops.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using testing::all_multipliers;
using testing::memory_of;
using testing::one_joint;
using testing::Random;

/// 1 / (transfer from the command to the torque, in z)
Complex per_actuation(const SampledLoop& loop, Complex z) {
  const double a = std::exp(-2 * std::numbers::pi * loop.torque_cutoff * loop.period);
  const Complex filter = loop.torque_cutoff > 0 ? (1 - a) * z / (z - a) : 1;
  return std::pow(z, loop.delay) / filter;
}

/// A mass under held torque moves by q += T q' + T^2/2 M^-1 f, q' += T M^-1 f, so that
///     det( (z - 1)^2 / actuation(z) M + T^2 (z + 1)/2 K + T (z - 1) C ) = 0,
/// with (z^2 - 1) / (2 z) for z - 1 in the last term if velocities are differenced.
/// A memory of the controller adds  output (z - state)^-1 position  to K.
TEST(SampledLoop, SolvesTheCharacteristicEquation) {
  for (std::uint64_t seed = 1; seed <= 80; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Eigen::Index n = random.integer(1, 6), m = seed % 2 == 0 ? 0 : random.integer(1, 6);
    const System<> system = testing::random_system(random, n);
    SampledLoop loop = testing::random_loop(random);
    if (m > 0) {
      loop.period = std::max(loop.period, 5e-4);
      loop.memory.state = random.matrix(m, m) / static_cast<double>(m);
      loop.memory.position = random.matrix(m, n);
      loop.memory.output = 100 * random.matrix(n, m);
    }
    const SampledSpectrum sampled = testing::sample(system, loop);
    const std::vector<Complex> all = all_multipliers(sampled);
    EXPECT_EQ(static_cast<Eigen::Index>(all.size()), (2 + memory_of(loop)) * n + m);
    double largest = 0;
    for (const Complex z : all) {
      largest = std::max(largest, modulus(z));
      if (modulus(z) < 0.1) continue;  // of high multiplicity
      const double T = loop.period;
      const Complex damping = T * (loop.difference_velocity ? (z * z - 1.0) / (2.0 * z) : z - 1.0);
      MatrixXcd stiffness = system.stiffness.cast<Complex>();
      double slope = 0;  // of the memory's part, which is steep next to its own eigenvalues
      if (m > 0) {
        const MatrixXcd step = z * MatrixXd::Identity(m, m) - loop.memory.state;
        const MatrixXcd inverse = step.partialPivLu().inverse();
        slope = T * T * inverse.norm() * loop.memory.output.norm() * inverse.norm() *
                loop.memory.position.norm();
        stiffness += loop.memory.output * inverse * loop.memory.position;
      }
      const MatrixXcd P = (z - 1.0) * (z - 1.0) * per_actuation(loop, z) * system.mass +
                          T * T * (z + 1.0) / 2.0 * stiffness + damping * system.damping;
      const auto values = Eigen::JacobiSVD<MatrixXcd>(P).singularValues();
      // P is linear in z with slope about |z - 1|; z is good to the root of the precision at worst
      EXPECT_LT(values[n - 1], 1e-9 * (system.mass.norm() + slope) + 1e-7 * values[0]) << z;
    }
    EXPECT_NEAR(sampled.spectral_radius, largest, 1e-13);
    EXPECT_EQ(sampled.stable(), largest < 1);
  }
}

/// One joint with friction and gravity: with r1 and r2 the roots of M r^2 + D r + G, the robot's
/// transfer from held torque to position is, in partial fractions,
///     q / f = sum over i of (e^(r_i T) - 1) / (M r_i (r_i - r_j) (z - e^(r_i T))),
/// and the velocity has r_i times each term.
TEST(SampledLoop, KnowsFrictionAndGravity) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(seed);
    const double M = random.log_uniform(0.1, 5), C = random.log_uniform(1, 50);
    const double K = random.log_uniform(100, 2000), D = random.uniform(0.1, 0.9) * C;
    const double G = random.uniform(-20, 20);
    SampledLoop loop = testing::random_loop(random);
    loop.difference_velocity = false;
    loop.friction = MatrixXd::Constant(1, 1, D);
    loop.gravity_gradient = MatrixXd::Constant(1, 1, G);
    const double T = loop.period;
    const Complex root = std::sqrt(Complex(D * D - 4 * M * G));
    const Complex r[] = {(-D + root) / (2 * M), (-D - root) / (2 * M)};
    for (const Complex z : all_multipliers(testing::sample(one_joint(M, C, K), loop))) {
      if (modulus(z) < 1e-3) continue;  // memory that nothing reads
      Complex position = 0, velocity = 0;
      for (int i = 0; i < 2; ++i) {
        const Complex e = std::exp(r[i] * T);
        const Complex term = (e - 1.0) / (M * r[i] * (r[i] - r[1 - i]) * (z - e));
        position += term;
        velocity += r[i] * term;
      }
      const Complex command = (K - G) * position + (C - D) * velocity;
      EXPECT_LT(modulus(per_actuation(loop, z) + command), 1e-7 * (1 + modulus(command))) << z;
    }
  }
}

TEST(SampledLoop, PutsModesInThePlacesOfTheContinuousOnes) {
  int compared = 0;
  for (std::uint64_t seed = 100; seed < 160; ++seed) {
    Random random(seed);
    const System<> system = testing::random_system(random, random.integer(2, 7));
    const Spectrum<> spectrum = analyze(system);
    SampledLoop loop = testing::random_loop(random);
    loop.period = 0.003 / spectrum.modes[0].natural_frequency;
    loop.torque_cutoff *= 1e-3 / loop.period;
    const SampledSpectrum sampled = sample_loop(system, spectrum, loop);
    ASSERT_EQ(static_cast<int>(sampled.modes.size()), spectrum.modes.size());
    for (int k = 0; k < spectrum.modes.size(); ++k) {
      const Mode<>& mode = spectrum.modes[k];
      const SampledMode& image = sampled.modes[static_cast<std::size_t>(k)];
      for (std::size_t i = 0; i < 2 && std::abs(mode.damping_ratio - 1) > 0.1; ++i) {
        EXPECT_LT(modulus(image.eigenvalues[i] - mode.eigenvalues[i]),
                  0.05 * (1 + mode.damping_ratio) * modulus(mode.eigenvalues[i]));
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 300);
}

/// More damping than the hold allows: the matrix from tick to tick has two rows, and a negative z.
TEST(SampledLoop, SaysWhatAlternates) {
  SampledLoop loop;
  const double T = loop.period, K = 100;
  for (const double C : {1400.0, 1990.0, 2100.0}) {
    const SampledMode mode = testing::sample(one_joint(1, C, K), loop).modes.at(0);
    const double trace = 2 - K * T * T / 2 - C * T;
    const double determinant = (1 - K * T * T / 2) * (1 - C * T) + (T - C * T * T / 2) * K * T;
    const double root = std::sqrt(trace * trace / 4 - determinant);
    const double z = trace / 2 - root;
    ASSERT_LT(z, 0);
    EXPECT_EQ(mode.kind, z < -1 ? ModeKind::kUnstable : ModeKind::kAlternating) << C;
    EXPECT_EQ(mode.damped_frequency, std::numbers::pi / T);
    EXPECT_NEAR(mode.eigenvalues[0].real(), std::log(-z) / T, 1e-9 / T);
    EXPECT_NEAR(mode.discrete_eigenvalues[1].real(), trace / 2 + root, 1e-12);
    EXPECT_NEAR(mode.natural_frequency, modulus(mode.eigenvalues[0]), 1e-9);
    EXPECT_NEAR(mode.damping_ratio, -std::log(-z) / T / mode.natural_frequency, 1e-9);
  }
  const SampledMode calm = testing::sample(one_joint(1, 900, K), loop).modes.at(0);
  EXPECT_EQ(calm.kind, ModeKind::kOverdamped);
  loop.period = 1e-4;
  const SampledMode slow = testing::sample(one_joint(1, 200, 1000), loop).modes.at(0);
  EXPECT_EQ(slow.kind, ModeKind::kOverdamped);
  EXPECT_EQ(slow.damped_frequency, 0);
  EXPECT_NEAR(slow.eigenvalues[0].real(), -5.13, 0.01);
  EXPECT_NEAR(slow.eigenvalues[1].real(), -196.9, 0.1);  // -194.9, faster by its square times T/2
}

/// The larger of two negative z is the mode's.
TEST(SampledLoop, AlternatesAtTheSlowerOfTwoNegativeEigenvalues) {
  SampledLoop loop;
  loop.period = 1;
  // z^2 - (2 - C - K/2) z + 1 - C + K/2 = (z + 0.2) (z + 0.5)
  const SampledMode mode = testing::sample(one_joint(1, 1.8, 1.8), loop).modes.at(0);
  EXPECT_NEAR(mode.discrete_eigenvalues[0].real(), -0.5, 1e-12);
  EXPECT_NEAR(mode.discrete_eigenvalues[1].real(), -0.2, 1e-12);
  EXPECT_EQ(mode.kind, ModeKind::kAlternating);
  EXPECT_NEAR(mode.damping_ratio * mode.natural_frequency, std::log(2), 1e-12);
}

TEST(SampledLoop, IsTheSameInFixedStorage) {
  Random random(170);
  const System<> system = testing::random_system(random, 6);
  System<kMaxDof> fixed(6);
  fixed.mass = system.mass;
  fixed.damping = system.damping;
  fixed.stiffness = system.stiffness;
  Spectrum<kMaxDof> spectrum;
  SpectrumSolver<kMaxDof> solver;
  ASSERT_EQ(solver.solve(fixed, spectrum), Status::kOk);
  const SampledLoop loop = testing::random_loop(random);
  const SampledSpectrum a = testing::sample(system, loop), b = sample_loop(fixed, spectrum, loop);
  ASSERT_EQ(a.modes.size(), b.modes.size());
  for (std::size_t k = 0; k < a.modes.size(); ++k) {
    EXPECT_NEAR(a.modes[k].natural_frequency, b.modes[k].natural_frequency, 1e-9);
    EXPECT_NEAR(a.modes[k].damping_ratio, b.modes[k].damping_ratio, 1e-10);
  }
}

/// A free self-motion has z = 1, twice if nothing damps it: neither counts.
TEST(SampledLoop, LeavesOutTheOnesOfZeroModes) {
  for (std::uint64_t seed = 200; seed < 220; ++seed) {
    Random random(seed);
    System<> system = to_joint_space(testing::random_impedance(random, 7, 6));
    SampledLoop loop = testing::random_loop(random);
    loop.period = 1e-4;
    const SampledSpectrum free = testing::sample(system, loop);
    const Eigen::Index memory = memory_of(loop);
    EXPECT_TRUE(free.zero_modes.empty());
    // The self-motion's own memory is deadbeat or the filter's: 7 * memory in all.
    EXPECT_EQ(static_cast<Eigen::Index>(free.others.size()), 7 * memory);
    EXPECT_LT(free.spectral_radius, 1 - 1e-6);
    EXPECT_TRUE(free.stable());

    loop.friction = 0.5 * MatrixXd::Identity(7, 7);
    system.damping += MatrixXd(loop.friction);
    const Spectrum<> spectrum = analyze(system);
    const SampledSpectrum damped = sample_loop(system, spectrum, loop);
    ASSERT_EQ(damped.zero_modes.size(), 1u);
    EXPECT_EQ(static_cast<Eigen::Index>(damped.others.size()), 7 * memory);
    const double rate = std::log(damped.zero_modes[0].real()) / loop.period;
    EXPECT_NEAR(rate, spectrum.zero_mode_rates[0], 0.02 * std::abs(spectrum.zero_mode_rates[0]));
    EXPECT_GE(damped.spectral_radius, damped.zero_modes[0].real());
    EXPECT_TRUE(damped.stable());
  }
}

/// Every motion drifts, and none is left to have a discrete eigenvalue.
TEST(SampledLoop, HasNothingToAnalyseWhereNothingHoldsOrDamps) {
  Random random(31);
  System<> system(3);
  system.mass = random.spd(3);
  const Spectrum<> spectrum = analyze(system);
  ASSERT_EQ(spectrum.zero_modes.basis.cols(), 3);
  EXPECT_EQ(testing::sample(system, {}).spectral_radius, 0);
  EXPECT_TRUE(testing::sample(system, {}).others.empty());
  EXPECT_EQ(gain_margin(system, spectrum, {}, 2), std::numeric_limits<double>::infinity());
}

/// Gravity that is compensated a moment too late moves a free mass that stands on top of a hill
/// only if it moves already: positions stay at z = 1 whatever the delay.
TEST(SampledLoop, KeepsZeroModesInCompensatedGravity) {
  for (const int delay : {0, 2}) {
    SampledLoop loop;
    loop.delay = delay;
    loop.torque_cutoff = 100;
    loop.gravity_gradient = MatrixXd::Constant(1, 1, -5.0);
    const SampledSpectrum sampled = testing::sample(one_joint(2, 6, 0), loop);
    ASSERT_EQ(sampled.zero_modes.size(), 1u);
    EXPECT_EQ(sampled.others.size(), static_cast<std::size_t>(delay + 1));
    const double lag = 0.001 * (delay + 0.5) + 1 / (2 * std::numbers::pi * 100);
    EXPECT_NEAR(std::log(sampled.zero_modes[0].real()) / 0.001, -3 + 2.5 * lag, 0.2);
    EXPECT_TRUE(sampled.stable());
  }
}

/// Springs and dampers in 6 directions of a longer arm give 6 commands to delay and filter, and the
/// same eigenvalues as if there were one for each joint.
TEST(SampledLoop, DelaysOnlyTheCommandsThatThereAre) {
  int largest = 0;
  for (std::uint64_t seed = 230; seed < 260; ++seed) {
    Random random(seed);
    const int n = random.integer(7, 9);
    System<> system = to_joint_space(testing::random_impedance(random, n, 6));
    SampledLoop loop = testing::random_loop(random);
    loop.delay = random.integer(1, 4);
    if (random.integer(0, 1) == 1) {  // of the joints, which nothing delays
      loop.friction = 0.5 * MatrixXd::Identity(n, n);
      system.damping += MatrixXd(loop.friction);
    }
    SampledDataModel model(system, analyze(system), loop);
    EXPECT_EQ(model.commands.cols(), 6);
    const Eigen::VectorXcd few = model.discrete_eigenvalues();
    const double radius = few.cwiseAbs().maxCoeff();
    const Eigen::Index rows = model.rows();
    model.commands.setIdentity(n, n);
    EXPECT_EQ(model.rows() - rows, (n - 6) * (loop.delay + (model.filtered() ? 1 : 0)));
    const Eigen::VectorXcd all = model.discrete_eigenvalues();
    ASSERT_EQ(few.size(), all.size());
    EXPECT_NEAR(radius, all.cwiseAbs().maxCoeff(), 1e-10);
    for (const Complex& z : all) {  // those at zero are defective, and none of theirs is exact
      if (std::abs(z) < 0.1) continue;
      const bool doubled = ((all.array() - z).abs() < 1e-6).count() > 1;  // known to a root of eps
      EXPECT_LT((few.array() - z).abs().minCoeff(), doubled ? 1e-7 : 1e-9) << z;
      ++largest;
    }
    const auto beyond = [](const Eigen::VectorXcd& values) {
      return (values.array().abs() > 0.1).count();
    };
    EXPECT_EQ(beyond(few), beyond(all));
  }
  EXPECT_GT(largest, 300);
}

/// A command that is small beside the others counts too.
TEST(SampledLoop, DelaysACommandThatIsSmall) {
  System<> system(2);
  system.mass.setIdentity();
  system.stiffness = Eigen::Vector2d(1e4, 1e-4).asDiagonal();
  system.damping = Eigen::Vector2d(100, 2e-3).asDiagonal();
  SampledLoop loop;
  loop.delay = 3;
  EXPECT_EQ(SampledDataModel(system, analyze(system), loop).commands.cols(), 2);
  system.stiffness(1, 1) = system.damping(1, 1) = 0;
  EXPECT_EQ(SampledDataModel(system, analyze(system), loop).commands.cols(), 1);
  loop.memory = {MatrixXd::Identity(1, 1), MatrixXd::Constant(1, 2, 1e9),
                 MatrixXd{{0}, {1e-9}}};  // small, of a state that is large
  EXPECT_EQ(SampledDataModel(system, analyze(system), loop).commands.cols(), 2);
}

TEST(SampledLoop, RefusesOptionsThatMakeNoSense) {
  const System<> system = one_joint(1, 2, 3);
  const auto refused = [&](const SampledLoop& loop) {
    return testing::refusal<std::invalid_argument>([&] { testing::sample(system, loop); });
  };
  EXPECT_EQ(refused({}), "accepted");
  EXPECT_EQ(refused({.period = 0}), "sample_loop: period has to be positive, s");
  EXPECT_EQ(refused({.delay = -1}), "sample_loop: delay must not be negative, ticks");
  EXPECT_EQ(refused({.torque_cutoff = -1}),
            "sample_loop: torque_cutoff must be finite and not negative, Hz");
  EXPECT_EQ(refused({.friction = MatrixXd::Zero(2, 2)}), "sample_loop: friction has to be n x n");
  EXPECT_EQ(refused({.gravity_gradient = MatrixXd::Constant(1, 1, std::nan(""))}),
            "sample_loop: gravity_gradient is not finite");
  const Spectrum<> other = analyze(System<>(2));
  EXPECT_THROW(sample_loop(system, other, {}), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::analysis
