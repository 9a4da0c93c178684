// Paths through the hard places: critical damping, veering, exceptional points, real eigenvalues of
// different modes that meet, coincidences, singular arms, jumps.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>
#include <dashpot/tests/support/true_spectrum.hpp>

#include <gtest/gtest.h>

#include <functional>
#include <numbers>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::expect_enclosed;
using testing::Random;

System<kMaxDof> system_of(const MatrixXd& mass, const MatrixXd& damping,
                          const MatrixXd& stiffness) {
  System<kMaxDof> system(mass.rows());
  system.mass = 0.5 * (mass + mass.transpose());
  system.damping = 0.5 * (damping + damping.transpose());
  system.stiffness = 0.5 * (stiffness + stiffness.transpose());
  return system;
}

/// A path is followed, and its bounds are checked at every `apart`-th step.
struct Follower : testing::Tracked {
  using Tracked::Tracked;

  void follow(int steps, int apart, const std::function<System<kMaxDof>(double)>& at) {
    for (int step = 0; step <= steps; ++step) {
      const System<kMaxDof> system = at(static_cast<double>(step) / steps);
      ASSERT_EQ(update(system), Status::kOk) << "step " << step;
      std::vector<double> now;
      for (int i = 0; i < spectrum->mode_count; ++i) {
        now.push_back(mode(i).natural_frequency);
        largest_jump =
            std::max(largest_jump, last.empty() ? 0 : std::abs(now.back() - last[now.size() - 1]));
      }
      last = now;
      if (step % apart != 0) continue;
      SCOPED_TRACE("step " + std::to_string(step));
      expect_enclosed(system, *spectrum);
    }
  }

  std::vector<double> last;
  double largest_jump = 0;  ///< of a natural frequency from one step to the next, rad/s
};

/// The only call of the direct solver was the first.
void expect_followed(const TrackerCounters& counters) {
  EXPECT_EQ(counters.direct, 1);
  EXPECT_EQ(counters.failed, 0);
  EXPECT_EQ(counters.tracked + counters.reused, counters.updates() - 1);
}

TEST(TrackedPath, ThroughCriticalDampingIsSmooth) {
  Random random(3001);
  const MatrixXd T = random.spd(3);
  const VectorXd omega = (VectorXd(3) << 4, 7, 12).finished();
  Follower follower;
  follower.follow(2000, 20, [&](double t) {
    const double zeta = 0.5 + 1.2 * t;  // all three pass through 1, proportionally damped
    const VectorXd d = 2 * zeta * omega, k = omega.cwiseAbs2();
    return system_of(T * T, T * d.asDiagonal() * T, T * k.asDiagonal() * T);
  });
  expect_followed(follower.counters());
  EXPECT_LT(follower.largest_jump, 1e-9);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(follower.mode(i).natural_frequency, omega[2 - i], 1e-10);
    EXPECT_NEAR(follower.mode(i).damping_ratio, 1.7, 1e-10);
    EXPECT_EQ(follower.mode(i).kind, ModeKind::kOverdamped);
  }
}

TEST(TrackedPath, StandsAtExactlyCriticalDamping) {
  Follower follower;
  follower.follow(200, 1, [&](double t) {
    // The first mode stays exactly critical while the second one changes.
    return system_of(MatrixXd::Identity(2, 2), Eigen::Vector2d(2, 1 + t).asDiagonal(),
                     Eigen::Vector2d(1, 16 + t).asDiagonal());
  });
  expect_followed(follower.counters());
  EXPECT_EQ(follower.mode(1).kind, ModeKind::kCritical);
  EXPECT_NEAR(follower.mode(1).damping_ratio, 1, 1e-13);
}

/// Two oscillators whose frequencies exchange, coupled so that they come no nearer than `gap`.
System<kMaxDof> exchange(double t, double gap) {
  const double w = 10, difference = 4 * (t - 0.5);
  MatrixXd K(2, 2);
  K << w * w + w * difference, w * gap, w * gap, w * w - w * difference;
  return system_of(MatrixXd::Identity(2, 2), 0.1 * MatrixXd::Identity(2, 2), K);
}

TEST(TrackedPath, VeersWhereModesAreCoupled) {
  for (const double gap : {1.0, 0.3, 0.1, 0.03}) {
    SCOPED_TRACE(gap);
    Follower follower;
    follower.follow(4000, 40, [&](double t) { return exchange(t, gap); });
    expect_followed(follower.counters());
    EXPECT_GT(follower.mode(0).natural_frequency, follower.mode(1).natural_frequency);
    EXPECT_LT(follower.largest_jump, 1e-3);
  }
}

TEST(TrackedPath, CrossesWhereModesAreNotCoupled) {
  for (const int steps : {4000, 3999}) {  // even: one step is exactly at the crossing
    Follower follower;
    follower.follow(steps, 40, [&](double t) { return exchange(t, 0); });
    expect_followed(follower.counters());
    EXPECT_LT(follower.mode(0).natural_frequency, follower.mode(1).natural_frequency);
    EXPECT_LT(follower.largest_jump, 1e-3);
    EXPECT_EQ(follower.spectrum->order[0], 1);
  }
}

TEST(TrackedPath, CrossesInMixedCoordinatesWithHeavyDamping) {
  Random random(3002);
  const MatrixXd T = random.spd(4);
  for (const double zeta : {0.3, 0.98, 1.5}) {
    SCOPED_TRACE(zeta);
    Follower follower;
    follower.follow(3000, 30, [&](double t) {
      VectorXd omega(4);
      omega << 8 + 4 * t, 10, 12 - 4 * t, 30;  // three meet at t = 0.5
      return system_of(T * T, T * (2 * zeta * omega).asDiagonal() * T,
                       T * omega.cwiseAbs2().asDiagonal() * T);
    });
    EXPECT_GE(follower.counters().tracked, 2990);
    EXPECT_LT(follower.largest_jump, 5e-3);
    EXPECT_EQ(follower.mode(0).natural_frequency, follower.last[0]);
  }
}

TEST(TrackedPath, AroundAnExceptionalPointExchangesTheModes) {
  // Two oscillators, equally stiff but not equally damped: for a coupling of about w (c1 - c2) / 2
  // both pairs of eigenvalues coincide and have one eigenvector.
  const double w = 10, c1 = 2, c2 = 0.4, center = w * (c1 - c2) / 2;
  const auto at = [&](double t) {
    const double angle = 2 * std::numbers::pi * t, radius = 0.5 * center;
    const double difference = radius * std::sin(angle),
                 coupling = center + radius * std::cos(angle);
    MatrixXd K(2, 2);
    K << w * w + difference, coupling, coupling, w * w - difference;
    return system_of(MatrixXd::Identity(2, 2), Eigen::Vector2d(c1, c2).asDiagonal(), K);
  };
  Follower follower;
  follower.follow(1, 1, [&](double) { return at(0); });
  const ModeNumbers first = follower.mode(0), second = follower.mode(1);
  EXPECT_GT(std::abs(first.eigenvalues[0] - second.eigenvalues[0]), 0.1);
  follower.follow(2000, 20, at);
  EXPECT_NEAR(std::abs(follower.mode(0).eigenvalues[0] - second.eigenvalues[0]), 0, 1e-9);
  EXPECT_NEAR(std::abs(follower.mode(1).eigenvalues[0] - first.eigenvalues[0]), 0, 1e-9);
  follower.follow(2000, 20, at);
  EXPECT_NEAR(std::abs(follower.mode(0).eigenvalues[0] - first.eigenvalues[0]), 0, 1e-9);
  EXPECT_EQ(follower.counters().direct, 1);
  // A loop beside the point brings each mode back to itself.
  Follower beside;
  const auto shifted = [&](double t) {
    System<kMaxDof> system = at(t);
    system.stiffness(0, 0) += 3 * center;
    return system;
  };
  beside.follow(1, 1, [&](double) { return shifted(0); });
  const ModeNumbers before = beside.mode(0);
  beside.follow(2000, 20, shifted);
  EXPECT_NEAR(std::abs(beside.mode(0).eigenvalues[0] - before.eigenvalues[0]), 0, 1e-9);
}

TEST(TrackedPath, RealEigenvaluesOfTwoModesMeetAndPartAgain) {
  // The fast eigenvalue of the first mode, -3.73, meets the slow one of the second; coupled, the
  // two turn complex for a while.
  for (const double coupling : {0.0, 1e-6, 0.01, 0.3, 1.5}) {
    SCOPED_TRACE(coupling);
    Follower follower;
    follower.follow(4000, 20, [&](double t) {
      const double c = 25 + 15 * t;  // of the second: slow eigenvalue from -5 to -2.7
      MatrixXd C(2, 2), K(2, 2);
      C << 4, coupling, coupling, c;
      K << 1, 0.3 * coupling, 0.3 * coupling, 100;
      return system_of(MatrixXd::Identity(2, 2), C, K);
    });
    EXPECT_GE(follower.counters().tracked, 3990);
  }
}

TEST(TrackedPath, ModesThatStayEqualAreReportedEqual) {
  Random random(3003);
  const MatrixXd T = random.spd(5);
  for (const double zeta : {0.0, 0.2, 1.0, 2.0}) {
    SCOPED_TRACE(zeta);
    Follower follower;
    follower.follow(300, 5, [&](double t) {
      const double omega = 5 + t;
      VectorXd w(5);
      w << omega, omega, omega, 20, 20;
      return system_of(T * T, T * (2 * zeta * w).asDiagonal() * T,
                       T * w.cwiseAbs2().asDiagonal() * T);
    });
    for (int i = 0; i < 5; ++i) {
      EXPECT_NEAR(follower.mode(i).natural_frequency, i < 2 ? 20 : 6, 1e-5);
      EXPECT_NEAR(follower.mode(i).damping_ratio, zeta, 1e-5);
    }
    EXPECT_GE(follower.counters().tracked, 290);
  }
}

/// A system that stands still has the numbers and shapes of the update before, to the last bit.
TEST(TrackedPath, FrozenInputIsReused) {
  Follower follower;
  follower.follow(10, 1, [&](double t) { return exchange(0.1 + 0.01 * t, 0.5); });
  const TrackedSpectrum moving = *follower.spectrum;
  EXPECT_EQ(moving.origin, SpectrumOrigin::kTracked);
  follower.follow(100, 10, [&](double) { return exchange(0.11, 0.5); });
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
  follower.follow(1, 1, [&](double) {
    System<kMaxDof> system = exchange(0.11, 0.5);
    system.damping(1, 1) = std::nextafter(system.damping(1, 1), 1);
    return system;
  });
  EXPECT_EQ(follower.counters().reused, 102);
  EXPECT_EQ(follower.counters().tracked, 11);
}

TEST(TrackedPath, JumpsAreSolvedAnew) {
  Random random(3005);
  Follower follower;
  follower.follow(60, 1, [&](double) {
    return system_of(random.spd(6), 3 * random.spd(6), 100 * random.spd(6));
  });
  EXPECT_GE(follower.counters().direct, 30);
}

TEST(TrackedPath, KeepsPlacesWhereAJumpIsSolvedAnew) {
  // The shapes turn by 40 degrees at once, too much to be followed, and the frequencies change.
  const auto at = [](double degrees, double high, double low) {
    const double angle = degrees * std::numbers::pi / 180;
    MatrixXd R(2, 2);
    R << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    return system_of(MatrixXd::Identity(2, 2), 0.2 * MatrixXd::Identity(2, 2),
                     R * Eigen::Vector2d(high * high, low * low).asDiagonal() * R.transpose());
  };
  Follower follower;
  follower.follow(50, 5, [&](double t) { return at(t, 20, 3 + t); });
  follower.follow(1, 1, [&](double) { return at(40, 3, 20); });
  EXPECT_EQ(follower.counters().direct, 2);
  EXPECT_NEAR(follower.mode(0).natural_frequency, 3, 1e-6);
  EXPECT_NEAR(follower.mode(1).natural_frequency, 20, 1e-6);
}

TEST(TrackedPath, PartsModesThatNearlyCrossBetweenTwoSteps) {
  for (const double gap : {1e-3, 1e-5, 1e-8, 1e-11}) {
    for (const double shift : {0.0, 1e-4, 3e-4}) {  // of the crossing against the steps
      SCOPED_TRACE(gap);
      Follower follower;
      follower.follow(500, 1, [&](double t) { return exchange(t + shift, gap); });
      EXPECT_GE(follower.counters().tracked, 495);
      EXPECT_NEAR(follower.mode(0).damping_ratio * follower.mode(0).natural_frequency, 0.05, 1e-9);
    }
  }
}

/// The frequencies of three modes are exchanged, their shapes hardly changed.
TEST(TrackedPath, KeepsPlacesOverASmallJumpUnlessToldToForget) {
  const MatrixXd I = MatrixXd::Identity(3, 3);
  const auto at = [&](double a, double b, double c) {
    MatrixXd K = Eigen::Vector3d(a, b, c).asDiagonal();
    K(0, 1) = K(1, 0) = 0.5;
    return system_of(I, 0.3 * I, K);
  };
  using Told = void (ModeTracker::*)();
  for (const Told told : {Told{nullptr}, Told{&ModeTracker::reset}, Told{&ModeTracker::forget}}) {
    const bool forgets = told == Told{&ModeTracker::forget};
    Follower follower;
    follower.follow(3, 1, [&](double t) { return at(400 + t, 100, 25); });
    if (told != nullptr) ((*follower.tracker).*told)();
    follower.follow(1, 1, [&](double) { return at(25, 400, 100); });
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
  MatrixXd J = MatrixXd::Zero(2, 3), M = 0.05 * MatrixXd::Identity(3, 3);
  for (int link = 0; link < 3; ++link) {
    MatrixXd J_link = MatrixXd::Zero(2, 3);
    double angle = 0;
    Eigen::Vector2d joint = Eigen::Vector2d::Zero();
    std::vector<Eigen::Vector2d> joints;
    for (int k = 0; k <= link; ++k) {
      joints.push_back(joint);
      angle += q[k];
      joint += Eigen::Vector2d(std::cos(angle), std::sin(angle));
    }
    for (int k = 0; k <= link; ++k) {
      const Eigen::Vector2d arm = joint - joints[static_cast<std::size_t>(k)];
      J_link.col(k) << -arm.y(), arm.x();
    }
    M += J_link.transpose() * J_link;
    J = J_link;
  }
  const Eigen::Vector2d root_K(30, 20);
  System<kMaxDof> system = system_of(
      M,
      J.transpose() * Eigen::Vector2d(8, 12).asDiagonal() * J + friction * MatrixXd::Identity(3, 3),
      MatrixXd::Zero(3, 3));
  system.stiffness_factor = root_K.asDiagonal() * J;
  return system;
}

TEST(TrackedPath, GoesThroughAStretchedSingularityAndBack) {
  for (const double friction : {0.0, 0.2}) {
    SCOPED_TRACE(friction);
    TrackerOptions options;
    options.soft_frequency = 0.05;
    Follower follower(options);
    bool was_soft = false;
    double smallest = 1e9;
    follower.follow(4000, 10, [&](double t) {
      for (int i = 0; i < follower.spectrum->mode_count; ++i) {
        was_soft = was_soft || follower.mode(i).kind == ModeKind::kSoft;
        if (follower.mode(i).natural_frequency < smallest) {
          smallest = follower.mode(i).natural_frequency;
        }
      }
      // Stretched at t = 0.25 and 0.75, exactly so.
      const double bend = 0.8 * std::cos(2 * std::numbers::pi * t);
      const double exact = t == 0.25 || t == 0.75 ? 0 : bend;
      return planar_arm({0.3 + 0.2 * t, exact, 0.7 * exact}, friction);
    });
    EXPECT_TRUE(was_soft);
    EXPECT_LT(smallest, 0.05);
    EXPECT_EQ(follower.spectrum->mode_count, 2);
    EXPECT_EQ(follower.spectrum->zero_mode_count, 1);
    EXPECT_GE(follower.counters().tracked, 3990);
  }
}

TEST(TrackedPath, StartsAtASingularity) {
  Follower follower;
  follower.follow(500, 5, [&](double t) { return planar_arm({0.3, t, 0.7 * t}, 0.1); });
  EXPECT_EQ(follower.spectrum->mode_count, 2);
  EXPECT_GE(follower.counters().tracked, 490);
}

TEST(TrackedPath, OfAPandaArmIsFollowedAtAnyDamping) {
  for (const double ratio : {0.0, 0.03, 0.3, 1.0, 3.0, 10.0}) {
    SCOPED_TRACE(ratio);
    Follower follower;
    follower.follow(1000, 25,
                    [&](double t) { return testing::panda_impedance(testing::swing(t), ratio); });
    EXPECT_EQ(follower.spectrum->mode_count, 6);
    EXPECT_LE(follower.counters().direct, 5);
    if (ratio < 1) {
      expect_followed(follower.counters());
      EXPECT_LT(follower.largest_jump, 0.5);
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
