// Many modes near critical damping at one frequency: how impedance controllers are often tuned, and
// the hardest clusters of eigenvalues there are, since each mode is nearly defective by itself.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace dashpot::analysis {
namespace {

Eigen::MatrixXd symmetric_noise(Eigen::Index n, testing::Random& random) {
  return testing::symmetrized(random.matrix(n, n));
}

/// 2 q'' M + C q' + K q of a cluster at -1, coupled at random.
System<> cluster(Eigen::Index n, double coupling, testing::Random& random) {
  System<> system(n);
  system.damping = 2 * system.mass + coupling * symmetric_noise(n, random);
  system.stiffness = system.mass + coupling * symmetric_noise(n, random);
  return system;
}

/// Its modes are a root of the coupling apart, far more than the bounds, unless it is next to none.
TEST(NearCriticalCluster, IsSolvedAndBoundedHoweverWeaklyItsModesAreCoupled) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  testing::Random random(7001);
  for (const double coupling : {1e-12, 1e-11, 1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-3, 1e-2}) {
    for (Eigen::Index n = 2; n <= 7; ++n) {
      for (int repeat = 0; repeat < 10; ++repeat) {
        SCOPED_TRACE("coupling " + std::to_string(coupling) + ", n " + std::to_string(n));
        const System<> system = cluster(n, coupling, random);
        const Spectrum<> spectrum = analyze(system);
        ASSERT_EQ(spectrum.modes.size(), n);
        for (const Mode<>& mode : spectrum.modes) {
          EXPECT_LT(mode.backward_error, 1e-11);
          for (const Complex& value : mode.eigenvalues) {
            EXPECT_LT(modulus(value + 1.0), 10 * std::sqrt(coupling) + 1e-5);
          }
        }
        if (repeat > 0 || coupling < 1e-11 || coupling > 1e-3) continue;
        const auto truth = testing::proved_eigenvalues(system);
        for (const Mode<>& mode : spectrum.modes) {
          EXPECT_LT(mode.error_bound, 0.03 * std::sqrt(coupling));
          EXPECT_NE(mode.kind, ModeKind::kCritical);
          for (const Complex& value : mode.eigenvalues) {
            EXPECT_LE(testing::distance_to_nearest(value, truth), mode.error_bound);
          }
        }
      }
    }
  }
}

/// If the ratio is 1 to the last bit, equal frequencies are known to about the root of the rounding
/// errors, however ill conditioned the mass matrix is.
TEST(NearCriticalCluster, IsBoundedWhereModesCoincide) {
  testing::Random random(7005);
  for (int trial = 0; trial < 60; ++trial) {
    const int n = random.integer(3, 7), others = random.integer(0, n - 2);
    // Integers, and so exact.
    Eigen::MatrixXd L = Eigen::MatrixXd::Identity(n, n);
    for (int j = 0; j < n; ++j) {
      for (int i = j + 1; i < n; ++i) L(i, j) = random.integer(-3, 3);
    }
    Eigen::VectorXd w = Eigen::VectorXd::Constant(n, 7);
    w.tail(others).setConstant(6);
    System<> system(n);
    system.mass = L * L.transpose();
    system.damping = L * (2 * w).asDiagonal() * L.transpose();
    system.stiffness = L * w.cwiseAbs2().asDiagonal() * L.transpose();
    const Spectrum<> spectrum = analyze(system);
    EXPECT_EQ(spectrum.status, Status::kOk);
    ASSERT_EQ(spectrum.modes.size(), n);
    const double condition = system.mass.norm() * system.mass.inverse().norm();
    for (int i = 0; i < n; ++i) {
      const Mode<>& mode = spectrum.modes[i];
      EXPECT_EQ(mode.kind, ModeKind::kCritical);
      EXPECT_LT(mode.error_bound, 1e-6 * std::sqrt(condition)) << condition;
      EXPECT_LE(modulus(mode.eigenvalues[0] + w[i]), mode.error_bound);
    }
  }
}

/// The changes are far below the resolution of Newton's method in the basis.
TEST(NearCriticalCluster, IsFollowed) {
  testing::Random random(7003);
  for (const double coupling : {1e-9, 1e-8, 1e-7, 1e-6, 1e-4}) {
    for (Eigen::Index n = 2; n <= 7; ++n) {
      SCOPED_TRACE("coupling " + std::to_string(coupling) + ", n " + std::to_string(n));
      const Eigen::MatrixXd C1 = symmetric_noise(n, random), C2 = symmetric_noise(n, random);
      const Eigen::MatrixXd K1 = symmetric_noise(n, random), K2 = symmetric_noise(n, random);
      testing::Tracked tracked;
      for (int k = 0; k < 200; ++k) {
        const double c = std::cos(1e-3 * k), s = std::sin(1e-3 * k);
        System<kMaxDof> system(n);
        system.damping = 2 * system.mass + coupling * (c * C1 + s * C2);
        system.stiffness = system.mass + coupling * (c * K1 + s * K2);
        ASSERT_EQ(tracked.update(system), Status::kOk);
        for (int i = 0; i < tracked.spectrum->mode_count; ++i) {
          EXPECT_LT(tracked.mode(i).error_bound, 0.1 * std::sqrt(coupling));
        }
      }
      EXPECT_LE(tracked.counters().direct, 3);
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
