// Paths through the hard places: critical damping, veering, exceptional points, singular arms,
// jumps.
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <array>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::classical_system;
using testing::Follower;
using testing::Random;
using testing::symmetric_system;
using testing::SystemPath;

const MatrixXd kTwo = MatrixXd::Identity(2, 2);

TEST(TrackedPath, ThroughCriticalDampingIsSmooth) {
  Random random(3001);
  const MatrixXd T = random.spd(3);
  const VectorXd omega = (VectorXd(3) << 4, 7, 12).finished();
  Follower follower;
  follower.follow(
      [&](double t) {  // all three pass through 1
        return classical_system(T, omega, VectorXd::Constant(3, 0.5 + 1.2 * t));
      },
      2001, 1, 20);
  follower.expect_followed();
  EXPECT_LT(follower.largest_jump, 1e-9);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(follower.mode(i).natural_frequency, omega[2 - i], 1e-10);
    EXPECT_NEAR(follower.mode(i).damping_ratio, 1.7, 1e-10);
    EXPECT_EQ(follower.mode(i).kind, ModeKind::kOverdamped);
  }
  Follower stands;  // one mode stays exactly critical while the other one changes
  stands.follow(
      [&](double t) {
        return symmetric_system(kTwo, Eigen::Vector2d(2, 1 + t).asDiagonal(),
                                Eigen::Vector2d(1, 16 + t).asDiagonal());
      },
      200);
  stands.expect_followed();
  EXPECT_EQ(stands.mode(1).kind, ModeKind::kCritical);
  EXPECT_NEAR(stands.mode(1).damping_ratio, 1, 1e-13);
}

/// Two oscillators whose frequencies exchange, coupled so that they come no nearer than `gap`.
System<kMaxDof> exchange(double t, double gap) {
  const double w = 10, difference = 4 * (t - 0.5);
  Eigen::Matrix2d K;
  K << w * w + w * difference, w * gap, w * gap, w * w - w * difference;
  return symmetric_system(kTwo, 0.1 * kTwo, K);
}

/// An even number of steps has one exactly at the crossing; gaps far below a step are crossed too.
TEST(TrackedPath, VeersWhereModesAreCoupledAndCrossesWhereTheyAreNot) {
  for (const double gap : {1.0, 0.3, 0.1, 0.03, 1e-5, 1e-11, 0.0}) {
    for (const int steps : {4000, 4001}) {
      SCOPED_TRACE(gap);
      Follower follower;
      follower.follow([&](double t) { return exchange(t, gap); }, steps, 1, 40);
      follower.expect_followed();
      EXPECT_LT(follower.largest_jump, 1e-3);
      if (gap > 0 && gap < 0.01) continue;  // either may be the nearer one
      const bool crosses = gap == 0;
      EXPECT_EQ(follower.mode(0).natural_frequency < follower.mode(1).natural_frequency, crosses);
      EXPECT_EQ(follower.spectrum->order[0], crosses ? 1 : 0);
    }
  }
  Random random(3002);
  const MatrixXd T = random.spd(4);
  for (const double zeta : {0.3, 0.98, 1.5}) {  // three meet, in mixed coordinates
    SCOPED_TRACE(zeta);
    Follower follower;
    follower.follow(
        [&](double t) {
          return classical_system(T, (VectorXd(4) << 8 + 4 * t, 10, 12 - 4 * t, 30).finished(),
                                  VectorXd::Constant(4, zeta));
        },
        3000, 1, 30);
    EXPECT_GE(follower.counters().tracked, 2990);
    EXPECT_LT(follower.largest_jump, 5e-3);
  }
}

TEST(TrackedPath, AroundAnExceptionalPointExchangesTheModes) {
  // Two oscillators, equally stiff but not equally damped: for a coupling of about w (c1 - c2) / 2
  // both pairs of eigenvalues coincide and have one eigenvector.
  const double w = 10, c1 = 2, c2 = 0.4, center = w * (c1 - c2) / 2;
  for (const bool around : {true, false}) {  // or beside it, which brings each back to itself
    const SystemPath at = [&](double t) {
      const double angle = 2 * std::numbers::pi * t, radius = 0.5 * center;
      const double x = radius * std::sin(angle), y = center + radius * std::cos(angle);
      Eigen::Matrix2d K;
      K << w * w + x + (around ? 0 : 3 * center), y, y, w * w - x;
      return symmetric_system(kTwo, Eigen::Vector2d(c1, c2).asDiagonal(), K);
    };
    Follower follower;
    follower.follow(at, 1);
    const std::array<ModeNumbers, 2> start{follower.mode(0), follower.mode(1)};
    EXPECT_GT(std::abs(start[0].eigenvalues[0] - start[1].eigenvalues[0]), 0.1);
    for (const bool once : {true, false}) {
      follower.follow(at, 2001, 1, 20);
      for (const int i : {0, 1}) {
        const auto& before = start[static_cast<std::size_t>(around && once ? 1 - i : i)];
        EXPECT_LE(std::abs(follower.mode(i).eigenvalues[0] - before.eigenvalues[0]), 1e-9);
      }
    }
    EXPECT_EQ(follower.counters().direct, 1);
  }
}

/// A system that stands still has the numbers and shapes of the update before, to the last bit.
TEST(TrackedPath, FrozenInputIsReused) {
  Follower follower;
  follower.follow([&](double t) { return exchange(0.1 + 0.01 * t, 0.5); }, 11);
  const TrackedSpectrum moving = *follower.spectrum;
  EXPECT_EQ(moving.origin, SpectrumOrigin::kTracked);
  follower.follow([&](double) { return exchange(0.11, 0.5); }, 101, 1, 10);
  EXPECT_EQ(follower.counters().reused, 101);
  EXPECT_EQ(follower.counters().direct, 1);
  EXPECT_EQ(follower.spectrum->origin, SpectrumOrigin::kReused);
  for (std::size_t i = 0; i < 2; ++i) {
    const ModeNumbers &was = moving.modes[i], &is = follower.spectrum->modes[i];
    EXPECT_EQ(is.eigenvalues, was.eigenvalues);
    EXPECT_EQ(is.error_bound, was.error_bound);
    EXPECT_EQ(is.damping_ratio_bound, was.damping_ratio_bound);
    EXPECT_EQ(follower.spectrum->shapes[i].u[0], moving.shapes[i].u[0]);
    EXPECT_EQ(follower.spectrum->shapes[i].slope, moving.shapes[i].slope);
  }
  // A change of the last bit of one coefficient is a change.
  follower.follow(
      [&](double) {
        System<kMaxDof> system = exchange(0.11, 0.5);
        system.damping(1, 1) = std::nextafter(system.damping(1, 1), 1);
        return system;
      },
      2);
  EXPECT_EQ(follower.counters().reused, 102);
  EXPECT_EQ(follower.counters().tracked, 11);
}

/// The frequencies of three modes are exchanged, their shapes hardly changed.
TEST(TrackedPath, KeepsPlacesOverASmallJumpUnlessToldToForget) {
  const MatrixXd I = MatrixXd::Identity(3, 3);
  const auto at = [&](double a, double b, double c) {
    MatrixXd K = Eigen::Vector3d(a, b, c).asDiagonal();
    K(0, 1) = K(1, 0) = 0.5;
    return symmetric_system(I, 0.3 * I, K);
  };
  using Told = void (ModeTracker::*)();
  for (const Told told : {Told{nullptr}, Told{&ModeTracker::reset}, Told{&ModeTracker::forget}}) {
    const bool forgets = told == Told{&ModeTracker::forget};
    Follower follower;
    follower.follow([&](double t) { return at(400 + t, 100, 25); }, 4);
    if (told != nullptr) ((*follower.tracker).*told)();
    follower.follow([&](double) { return at(25, 400, 100); }, 2);
    if (!forgets) EXPECT_LE(follower.counters().direct, 2);
    const std::array<double, 3> expected =
        forgets ? std::array{20.0, 10.0, 5.0} : std::array{5.0, 20.0, 10.0};
    for (const int i : {0, 1, 2}) {
      EXPECT_NEAR(follower.mode(i).natural_frequency, expected[static_cast<std::size_t>(i)], 0.01);
    }
  }
}

/// A planar arm of three unit links, its hand held in x and y; singular where it is stretched.
System<kMaxDof> planar_arm(const Eigen::Vector3d& q, double friction) {
  MatrixXd J(2, 3), M = 0.05 * MatrixXd::Identity(3, 3);
  for (int last = 0; last < 3; ++last) {  // J of the end of this link
    J.setZero();
    for (int link = last; link >= 0; --link) {
      const double angle = q.head(link + 1).sum();
      J.leftCols(link + 1).colwise() += Eigen::Vector2d(-std::sin(angle), std::cos(angle));
    }
    M += J.transpose() * J;
  }
  const Eigen::Vector2d root_K(30, 20), dampers(8, 12);
  System<kMaxDof> system = symmetric_system(
      M, J.transpose() * dampers.asDiagonal() * J + friction * MatrixXd::Identity(3, 3),
      MatrixXd::Zero(3, 3));
  system.stiffness_factor = root_K.asDiagonal() * J;
  return system;
}

struct SoftFollower : Follower {
  using Follower::Follower;
  void look(const System<kMaxDof>& /*system*/) override {
    for (int i = 0; i < spectrum->mode_count; ++i) {
      was_soft = was_soft || mode(i).kind == ModeKind::kSoft;
      smallest = std::min(smallest, mode(i).natural_frequency);
    }
  }
  bool was_soft = false;
  double smallest = 1e9;
};

TEST(TrackedPath, GoesThroughAStretchedSingularityAndStartsAtOne) {
  for (const double friction : {0.0, 0.1, 0.2}) {
    SCOPED_TRACE(friction);
    TrackerOptions options;
    options.soft_frequency = 0.05;
    SoftFollower follower(options);
    follower.follow(
        [&](double t) {  // stretched at t = 0.25 and 0.75, exactly so
          const double bend = 0.8 * std::cos(2 * std::numbers::pi * t);
          const double exact = t == 0.25 || t == 0.75 ? 0 : bend;
          return planar_arm({0.3 + 0.2 * t, exact, 0.7 * exact}, friction);
        },
        4001, 1, 10);
    EXPECT_TRUE(follower.was_soft);
    EXPECT_LT(follower.smallest, 0.05);
    Follower starts;
    starts.follow([&](double t) { return planar_arm({0.3, t, 0.7 * t}, friction); }, 501, 1, 5);
    for (const Follower* one : std::initializer_list<const Follower*>{&follower, &starts}) {
      EXPECT_EQ(one->spectrum->mode_count, 2);
      EXPECT_EQ(one->spectrum->zero_mode_count, 1);
      EXPECT_LE(one->counters().direct, 10);
    }
  }
}

TEST(TrackedPath, OfAPandaArmIsFollowedAtAnyDamping) {
  for (const double ratio : {0.0, 0.03, 0.3, 1.0, 3.0, 10.0}) {
    SCOPED_TRACE(ratio);
    Follower follower;
    follower.follow([&](double t) { return testing::panda_impedance(testing::swing(t), ratio); },
                    1001, 1, 25);
    EXPECT_EQ(follower.spectrum->mode_count, 6);
    EXPECT_LE(follower.counters().direct, ratio < 10 ? 5 : 10);
    if (ratio < 1) {
      follower.expect_followed();
      EXPECT_LT(follower.largest_jump, 0.5);
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
