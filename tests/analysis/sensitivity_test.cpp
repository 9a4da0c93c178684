// Sensitivities, beside central differences of spectra computed in long double.
#include <dashpot/analysis/sensitivity.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random_arms.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <complex>
#include <limits>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using testing::Random;
using Extended = long double;
using ExtendedMatrix = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic>;
using ExtendedComplex = std::complex<Extended>;

struct Coefficients {
  ExtendedMatrix mass, damping, stiffness;
};

Coefficients extended(const System<>& system) {
  return {system.mass.cast<Extended>(), system.damping.cast<Extended>(),
          system.stiffness.cast<Extended>()};
}

struct Pair {
  ExtendedComplex first, second;
  Extended frequency() const { return std::sqrt((first * second).real()); }
  Extended ratio() const { return -(first + second).real() / (2 * frequency()); }
};

/// The two eigenvalues nearest to the eigenvalues of `mode`.
Pair pair_of(const Coefficients& system, const Mode<>& mode) {
  const Index n = system.mass.rows();
  ExtendedMatrix A = ExtendedMatrix::Zero(2 * n, 2 * n);
  A.topRightCorner(n, n).setIdentity();
  const Eigen::PartialPivLU<ExtendedMatrix> mass(system.mass);
  A.bottomLeftCorner(n, n) = -mass.solve(system.stiffness);
  A.bottomRightCorner(n, n) = -mass.solve(system.damping);
  const Eigen::EigenSolver<ExtendedMatrix> solver(A, false);
  std::vector<ExtendedComplex> values(solver.eigenvalues().begin(), solver.eigenvalues().end());
  const auto take_nearest = [&values](const Complex& to) {
    const ExtendedComplex target{static_cast<Extended>(to.real()),
                                 static_cast<Extended>(to.imag())};
    const auto nearest = std::min_element(
        values.begin(), values.end(),
        [&](const auto& a, const auto& b) { return std::abs(a - target) < std::abs(b - target); });
    const ExtendedComplex value = *nearest;
    *nearest = std::numeric_limits<Extended>::infinity();  // taken
    return value;
  };
  Pair pair;
  pair.first = take_nearest(mode.eigenvalues[0]);
  pair.second = take_nearest(mode.eigenvalues[1]);
  return pair;
}

enum class Part { kMass, kDamping, kStiffness };

ExtendedMatrix& part_of(Coefficients& system, Part part) {
  return part == Part::kMass      ? system.mass
         : part == Part::kDamping ? system.damping
                                  : system.stiffness;
}

const ModeGradient& gradient_of(const ModeSensitivity& sensitivity, Part part) {
  return part == Part::kMass      ? sensitivity.mass
         : part == Part::kDamping ? sensitivity.damping
                                  : sensitivity.stiffness;
}

double dot(const MatrixXd& G, const MatrixXd& dA) {
  return G.cwiseProduct(dA).sum();
}

/// Compares along random symmetric directions; `eigenvalues` too where they are simple.
void expect_differences(const System<>& system, Random& random, double tolerance,
                        bool eigenvalues) {
  const Spectrum<> spectrum = analyze(system);
  const std::vector<ModeSensitivity> all = sensitivities(system, spectrum);
  ASSERT_EQ(static_cast<int>(all.size()), spectrum.modes.size());
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const Mode<>& mode = spectrum.modes[i];
    const ModeSensitivity& sensitivity = all[static_cast<std::size_t>(i)];
    EXPECT_TRUE(sensitivity.regular);
    for (const Part part : {Part::kMass, Part::kDamping, Part::kStiffness}) {
      SCOPED_TRACE("mode " + std::to_string(i) + ", part " +
                   std::to_string(static_cast<int>(part)));
      Coefficients up = extended(system), down = up;
      MatrixXd direction = random.matrix(system.dof(), system.dof());
      if (spectrum.symmetric) direction = (direction + direction.transpose()).eval();
      direction *= part_of(up, part).cast<double>().norm() / direction.norm();
      const Extended h = 1e-7L;
      part_of(up, part) += h * direction.cast<Extended>();
      part_of(down, part) -= h * direction.cast<Extended>();
      const Pair plus = pair_of(up, mode), minus = pair_of(down, mode);
      const ModeGradient& by = gradient_of(sensitivity, part);
      const auto difference = [h](Extended a, Extended b) {
        return static_cast<double>((a - b) / (2 * h));
      };
      const double omega = mode.natural_frequency;
      const double frequency = difference(plus.frequency(), minus.frequency());
      const double ratio = difference(plus.ratio(), minus.ratio());
      EXPECT_NEAR(dot(by.natural_frequency, direction), frequency,
                  tolerance * std::max(omega, std::abs(frequency)));
      EXPECT_NEAR(dot(by.damping_ratio, direction), ratio,
                  tolerance * std::max(1.0, std::abs(ratio)));
      if (!eigenvalues) continue;
      const Complex slope = by.eigenvalues[0].cwiseProduct(direction.cast<Complex>()).sum();
      EXPECT_NEAR(slope.real(), difference(plus.first.real(), minus.first.real()),
                  tolerance * omega);
      EXPECT_NEAR(slope.imag(), difference(plus.first.imag(), minus.first.imag()),
                  tolerance * omega);
    }
  }
}

System<> random_damped(Random& random, Index n, double damping) {
  System<> system(n);
  system.mass = random.spd(n);
  system.stiffness = 200 * random.spd(n);
  system.damping = damping * random.spd(n);
  return system;
}

/// The systems have light damping, heavy damping, and coefficients that are not symmetric.
TEST(Sensitivity, MatchesDifferencesInExtendedPrecision) {
  Random random(7201);
  for (int i = 0; i < 30; ++i) {
    SCOPED_TRACE("system " + std::to_string(i));
    const int kind = i % 3;
    System<> system =
        random_damped(random, random.integer(1, 6), kind == 0 ? random.log_uniform(0.1, 3) : 1);
    if (kind == 1) {
      system.damping = (40 * system.mass + 0.05 * system.stiffness).eval();
      system.damping = (0.5 * (system.damping + system.damping.transpose())).eval();
    } else if (kind == 2) {
      system.stiffness += random.matrix(system.dof(), system.dof());
    }
    expect_differences(system, random, kind == 1 ? 1e-6 : 1e-7, true);
  }
}

/// Mode 2 of 3 at damping ratio zeta, mixed with the others by a congruence.
System<> one_mode_at(Random& random, double zeta) {
  const Eigen::Vector3d omega(20, 8, 3), ratios(0.2, zeta, 0.4);
  const MatrixXd T = random.matrix(3, 3) + 2 * MatrixXd::Identity(3, 3);
  const auto mixed = [&T](const Eigen::Vector3d& values) {
    const MatrixXd A = T.transpose() * values.asDiagonal() * T;
    return MatrixXd(0.5 * (A + A.transpose()));
  };
  System<> system(3);
  system.mass = mixed(Eigen::Vector3d::Ones());
  system.damping = mixed(2 * ratios.cwiseProduct(omega));
  system.stiffness = mixed(omega.cwiseAbs2());
  return system;
}

TEST(Sensitivity, OfFrequencyAndRatioIsSmoothThroughCriticalDamping) {
  Random random(7204);
  for (const double distance : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 0.0, -1e-10, -1e-7, -1e-3}) {
    SCOPED_TRACE("1 - zeta = " + std::to_string(distance));
    expect_differences(one_mode_at(random, 1 - distance), random, 1e-7, false);
  }
}

// A single mass has omega = sqrt(k/m), zeta = c / (2 sqrt(k m)), at critical damping too.
TEST(Sensitivity, OfASingleMassIsTheTextbooks) {
  for (const double c : {0.5, 8.0, 30.0}) {  // critical: 8
    System<> system(1);
    system.mass << 2;
    system.stiffness << 8;
    system.damping << c;
    const ModeSensitivity by = sensitivities(system, analyze(system)).at(0);
    const double zeta = c / 8;
    EXPECT_NEAR(by.stiffness.natural_frequency(0, 0), 0.125, 1e-12);
    EXPECT_NEAR(by.mass.natural_frequency(0, 0), -0.5, 1e-12);
    EXPECT_NEAR(by.damping.natural_frequency(0, 0), 0, 1e-12);
    EXPECT_NEAR(by.damping.damping_ratio(0, 0), 0.125, 1e-12);
    EXPECT_NEAR(by.stiffness.damping_ratio(0, 0), -zeta / 16, 1e-12);
    EXPECT_NEAR(by.mass.damping_ratio(0, 0), -zeta / 4, 1e-12);
    EXPECT_TRUE(by.regular);
  }
}

TEST(Sensitivity, SaysWhereModesCoincide) {
  System<> system(2);
  system.mass = MatrixXd::Identity(2, 2);
  system.stiffness = 9 * MatrixXd::Identity(2, 2);
  system.stiffness(1, 1) += 1e-9;
  system.damping << 1, 1e-9, 1e-9, 1;
  int irregular = 0;
  for (const ModeSensitivity& one : sensitivities(system, analyze(system))) {
    irregular += one.regular ? 0 : 1;
  }
  EXPECT_EQ(irregular, 2);
}

TEST(TaskGradient, IsThatByTheTaskDamping) {
  Random random(7205);
  TaskImpedance arm = testing::random_arm(random, 7, 6);
  const MatrixXd C = 20 * random.spd(6), dC = random.spd(6);
  const double h = 1e-4;
  const auto spectrum_at = [&](double t) {
    arm.task_damping = C + t * dC;
    return analyze(to_joint_space(arm));
  };
  const Spectrum<> plus = spectrum_at(h), minus = spectrum_at(-h), here = spectrum_at(0);
  const std::vector<DampingGradient> gradients = damping_gradients(to_joint_space(arm), here);
  for (int i = 0; i < here.modes.size(); ++i) {
    const MatrixXd G =
        task_gradient(*arm.jacobian, gradients[static_cast<std::size_t>(i)].damping_ratio);
    EXPECT_EQ(G.rows(), 6);
    const double difference =
        (plus.modes[i].damping_ratio - minus.modes[i].damping_ratio) / (2 * h);
    EXPECT_NEAR(dot(G, dC), difference, 1e-6 * std::abs(difference) + 1e-9);
  }
}

}  // namespace
}  // namespace dashpot::analysis
