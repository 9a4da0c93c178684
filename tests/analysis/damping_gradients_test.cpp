// Derivatives of modes by the damping, beside central differences of spectra computed in long
// double.
#include <dashpot/analysis/response/damping_gradients.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/random.hpp>

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

double dot(const MatrixXd& G, const MatrixXd& dA) {
  return G.cwiseProduct(dA).sum();
}

/// Compares along random symmetric directions.
void expect_differences(const System<>& system, Random& random, double tolerance) {
  const Spectrum<> spectrum = analyze(system);
  const std::vector<MatrixXd> all = damping_gradients(system, spectrum);
  ASSERT_EQ(static_cast<int>(all.size()), spectrum.modes.size());
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    SCOPED_TRACE("mode " + std::to_string(i));
    const Mode<>& mode = spectrum.modes[i];
    MatrixXd direction = random.matrix(system.dof(), system.dof());
    if (spectrum.symmetric) direction = (direction + direction.transpose()).eval();
    direction *= system.damping.norm() / direction.norm();
    const Extended h = 1e-6L;
    Coefficients up = extended(system), down = up;
    up.damping += h * direction.cast<Extended>();
    down.damping -= h * direction.cast<Extended>();
    const Pair plus = pair_of(up, mode), minus = pair_of(down, mode);
    const auto difference = [h](Extended a, Extended b) {
      return static_cast<double>((a - b) / (2 * h));
    };
    const double ratio = difference(plus.ratio(), minus.ratio());
    EXPECT_NEAR(dot(all[static_cast<std::size_t>(i)], direction), ratio,
                tolerance * std::max(1.0, std::abs(ratio)));
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
TEST(DampingGradients, MatchDifferencesInExtendedPrecision) {
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
    expect_differences(system, random, kind == 1 ? 1e-6 : 1e-7);
  }
}

/// Mode 2 of 3 at damping ratio zeta, mixed with the others by a congruence.
System<> one_mode_at(Random& random, double zeta) {
  const Eigen::Vector3d omega(20, 8, 3), ratios(0.2, zeta, 0.4);
  // The singular values of T lie within 0.5 and 2: differences of a nearly singular one are curved.
  const auto turn = [&] { return MatrixXd(random.matrix(3, 3).householderQr().householderQ()); };
  MatrixXd T = turn();
  for (Index i = 0; i < 3; ++i) T.col(i) *= random.log_uniform(0.5, 2);
  T *= turn();
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

TEST(DampingGradients, AreSmoothThroughCriticalDamping) {
  Random random(7204);
  for (const double distance : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 0.0, -1e-10, -1e-7, -1e-3}) {
    SCOPED_TRACE("1 - zeta = " + std::to_string(distance));
    expect_differences(one_mode_at(random, 1 - distance), random, 1e-7);
  }
}

}  // namespace
}  // namespace dashpot::analysis
