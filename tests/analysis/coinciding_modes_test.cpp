// Modes of one frequency and ratio that stay so while their shapes turn: followed, with bounds that
// hold, and told apart when they part.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::Dice;
using testing::Follower;
using testing::SystemPath;

/// Springs and dampers that are multiples of a moving arm's mass matrix.
SystemPath shaped_panda(double ratio, bool factored) {
  return [=](double t) {
    System<kMaxDof> system(7);
    system.mass = testing::panda(testing::swing(t)).mass;
    system.damping = 2 * ratio * 20 * system.mass;
    system.stiffness = 400 * system.mass;
    if (factored) system.stiffness_factor = 20 * MatrixXd(system.mass.llt().matrixU());
    return system;
  };
}

TEST(CoincidingModes, OfAMovingArmAreFollowed) {
  for (const double ratio : {0.01, 0.2, 0.7, 0.9, 0.97, 1.05, 3.0}) {
    for (const bool factored : {false, true}) {
      SCOPED_TRACE(::testing::Message() << "ratio " << ratio << ", factored " << factored);
      Follower follower;
      follower.follow(shaped_panda(ratio, factored), 100, 0.1);
      follower.expect_followed();
      EXPECT_LE(follower.counters().iterations, 250);
      EXPECT_LE(follower.widest, 2e-8);
      for (int i = 0; i < 7; ++i) {
        EXPECT_NEAR(follower.mode(i).natural_frequency, 20, 1e-9);
        EXPECT_NEAR(follower.mode(i).damping_ratio, ratio, 1e-9);
      }
    }
  }
}

/// Some of them differ from then on, by more and more.
TEST(CoincidingModes, ArePartedWhenTheyDiffer) {
  const SystemPath same = shaped_panda(0.3, false);
  const SystemPath path = [&same](double t) {
    System<kMaxDof> system = same(t);
    const double late = std::max(0.0, t - 0.05);
    system.stiffness.diagonal() += 1e4 * late * late * Eigen::VectorXd::LinSpaced(7, 1, 4);
    return system;
  };
  Follower follower;
  follower.follow(path, 200, 0.15);
  EXPECT_LE(follower.counters().direct, 3);
  EXPECT_LE(follower.widest, 1e-8);
  std::vector<double> frequencies;
  for (int i = 0; i < 7; ++i) frequencies.push_back(follower.mode(i).natural_frequency);
  std::sort(frequencies.begin(), frequencies.end());
  for (std::size_t i = 0; i < 6; ++i) EXPECT_GT(frequencies[i + 1], 1.01 * frequencies[i]);
}

/// Modes of one ratio near 1 and different frequencies do not coincide, although steps are large.
TEST(CoincidingModes, AreNotSeenInModesOfOneRatio) {
  Dice dice(5);
  const MatrixXd T = dice.congruence(7, 3), turn = dice.matrix(7, 7);
  const Eigen::VectorXd w = (Eigen::VectorXd(7) << 5, 8, 12, 18, 25, 40, 60).finished();
  for (const double ratio : {0.9, 0.95, 0.98, 0.995, 1.05}) {
    for (const double pace : {0.001, 0.002}) {
      SCOPED_TRACE(::testing::Message() << "ratio " << ratio << ", pace " << pace);
      testing::Tracked tracked;
      for (int step = 0; step < 40; ++step) {
        const double angle = std::sin(step * step);  // nothing that one could extrapolate
        const MatrixXd turned = T * (MatrixXd::Identity(7, 7) + pace * angle * turn);
        ASSERT_EQ(tracked.update(
                      testing::classical_system(turned, w, Eigen::VectorXd::Constant(7, ratio))),
                  Status::kOk);
      }
      EXPECT_EQ(tracked.counters().direct, 1);
    }
  }
}

TEST(CoincidingModes, AreFollowedAlongHardPaths) {
  struct Family {
    SystemPath (*make)(Dice&);
    double tracked;  ///< least share of updates after the first
  };
  for (const auto& [make, tracked] :
       {Family{testing::coinciding, 0.95}, Family{testing::turning_coinciding, 0.98},
        Family{testing::skewed_coinciding, 0.95}}) {
    TrackerCounters sum;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed);
      Dice dice(seed);
      Follower follower;
      follower.follow(make(dice), 60, 0.3);
      EXPECT_LE(follower.widest, 1e-5);
      sum.tracked += follower.counters().tracked;
      sum.direct += follower.counters().direct - 1;
    }
    EXPECT_GE(static_cast<double>(sum.tracked),
              tracked * static_cast<double>(sum.tracked + sum.direct));
  }
}

// Many modes near critical damping at one frequency: how impedance controllers are often tuned, and
// the hardest clusters of eigenvalues there are, since each mode is nearly defective by itself.

Eigen::MatrixXd symmetric_noise(Eigen::Index n, testing::Random& random) {
  return testing::symmetrized(random.matrix(n, n));
}

/// certified_referee_test.cpp has the bounds.
TEST(NearCriticalCluster, IsSolvedHoweverWeaklyItsModesAreCoupled) {
  testing::Random random(7001);
  for (const double coupling : {1e-12, 1e-11, 1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-3, 1e-2}) {
    for (int trial = 0; trial < 60; ++trial) {
      const Eigen::Index n = 2 + trial % 6;
      System<> system(n);
      system.damping = 2 * system.mass + coupling * symmetric_noise(n, random);
      system.stiffness = system.mass + coupling * symmetric_noise(n, random);
      const Spectrum<> spectrum = analyze(system);
      ASSERT_EQ(spectrum.modes.size(), n);
      for (const Mode<>& mode : spectrum.modes) EXPECT_LT(mode.backward_error, 1e-11);
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
