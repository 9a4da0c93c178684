// Results of the tracker for single systems: shapes, slopes, states, counters, failures.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::backward_error;
using testing::expect_enclosed;
using testing::panda_impedance;
using testing::Random;
using testing::swing;
using testing::Tracked;

System<kMaxDof> random_fixed_system(Random& random, int n, double damping) {
  System<kMaxDof> system(n);
  system.mass = random.spd(n);
  system.damping = damping * random.spd(n);
  system.stiffness = 100 * random.spd(n);
  return system;
}

TEST(ModeTracker, GivesEigenvectorsOfSmallBackwardError) {
  for (const double ratio : {0.05, 0.5, 2.0}) {
    SCOPED_TRACE(ratio);
    Tracked tracked;
    for (int step = 0; step < 300; ++step) {
      const System<kMaxDof> system = panda_impedance(swing(1e-3 * step), ratio);
      ASSERT_EQ(tracked.update(system), Status::kOk);
      for (int i = 0; i < 6; ++i) {
        const TrackedShapes& shapes = tracked.spectrum->shapes[static_cast<std::size_t>(i)];
        for (std::size_t k = 0; k < 2; ++k) {
          const Complex value = tracked.mode(i).eigenvalues[k];
          const ComplexVector<kMaxDof>& u = shapes.u[k];
          ASSERT_EQ(u.size(), 7);
          EXPECT_LE(backward_error(system, value, u), ratio > 1 ? 1e-13 : 1e-14) << "step " << step;
          EXPECT_NEAR((u.adjoint() * system.mass * u).value().real(), 1, 1e-12);
          Eigen::Index largest = 0;
          u.cwiseAbs().maxCoeff(&largest);
          EXPECT_NEAR(u[largest].imag(), 0, 1e-14);
          EXPECT_GT(u[largest].real(), 0);
          const Complex slope =
              (u.transpose() * (2.0 * value * (system.mass * u) + system.damping * u)).value();
          EXPECT_LE(std::abs(slope - shapes.slope[k]), 1e-8 * std::abs(value));
        }
      }
    }
  }
}

TEST(ModeTracker, SlopePredictsHowAnEigenvalueMoves) {
  Random random(4001);
  const System<kMaxDof> system = random_fixed_system(random, 5, 2);
  System<kMaxDof> changed = system;
  const MatrixXd dC = random.spd(5);
  changed.damping += 1e-6 * dC;
  Tracked tracked;
  ASSERT_EQ(tracked.update(system), Status::kOk);
  const auto before = tracked.spectrum->modes;
  const auto shapes = tracked.spectrum->shapes;
  ASSERT_EQ(tracked.update(changed), Status::kOk);
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kTracked);
  for (std::size_t i = 0; i < 5; ++i) {
    const auto& u = shapes[i].u[0];
    const Complex lambda = before[i].eigenvalues[0];
    const Complex predicted = -lambda * (u.transpose() * dC * u).value() / shapes[i].slope[0];
    const Complex seen = (tracked.spectrum->modes[i].eigenvalues[0] - lambda) / 1e-6;
    EXPECT_LE(std::abs(predicted - seen), 1e-4 * std::abs(predicted));
  }
}

TEST(ModeTracker, GivesTheSameNumbersWithoutShapes) {
  TrackerOptions options;
  options.shapes = false;
  Tracked with, without(options);
  for (int step = 0; step < 200; ++step) {
    const System<kMaxDof> system = panda_impedance(swing(1e-3 * step), 0.2);
    ASSERT_EQ(with.update(system), Status::kOk);
    ASSERT_EQ(without.update(system), Status::kOk);
    for (int i = 0; i < 6; ++i) {
      EXPECT_EQ(with.mode(i).natural_frequency, without.mode(i).natural_frequency);
      EXPECT_EQ(with.mode(i).damping_ratio, without.mode(i).damping_ratio);
      EXPECT_EQ(with.mode(i).error_bound, without.mode(i).error_bound);
    }
  }
  EXPECT_EQ(without.spectrum->shapes[0].u[0].size(), 0);
}

TEST(ModeTracker, SmallFrequenciesKeepTheirDigitsWithAFactor) {
  // 1e-5 beside 1e3 rad/s: squared, 16 orders of magnitude apart.
  System<kMaxDof> system(2);
  system.stiffness_factor.resize(2, 2);
  system.stiffness_factor << 1e3, 0, 0, 1e-5;
  system.damping << 0.2, 0, 0, 1e-6;
  Tracked tracked;
  ASSERT_EQ(tracked.update(system), Status::kOk);
  system.mass(0, 0) = 1.0001;  // followed, too
  ASSERT_EQ(tracked.update(system), Status::kOk);
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kTracked);
  EXPECT_NEAR(tracked.mode(1).natural_frequency, 1e-5, 1e-19);
  EXPECT_NEAR(tracked.mode(1).damping_ratio, 0.05, 1e-12);
}

TEST(ModeTracker, SaysWhatIsWrongAndRecovers) {
  Random random(4003);
  System<kMaxDof> good = random_fixed_system(random, 4, 1);
  good.stiffness_factor = 10 * random.matrix(3, 4);
  Tracked tracked;
  const auto expect_failure = [&](const System<kMaxDof>& bad, Status status) {
    ASSERT_EQ(tracked.update(good), Status::kOk);
    EXPECT_EQ(tracked.update(bad), status);
    EXPECT_EQ(tracked.spectrum->status, status);
    EXPECT_EQ(tracked.spectrum->mode_count, 0);
    EXPECT_EQ(tracked.spectrum->zero_mode_count, 0);
    ASSERT_EQ(tracked.update(good), Status::kOk);
    EXPECT_EQ(tracked.spectrum->mode_count, 3);
  };
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  using Change = void (*)(System<kMaxDof>&);
  for (const auto& [change, status] : std::initializer_list<std::pair<Change, Status>>{
           {[](System<kMaxDof>& s) { s.mass(1, 1) = kNan; }, Status::kNotFinite},
           {[](System<kMaxDof>& s) { s.damping(0, 2) = -std::numeric_limits<double>::infinity(); },
            Status::kNotFinite},
           {[](System<kMaxDof>& s) { s.stiffness_factor.resize(0, 4), s.stiffness(2, 0) = kNan; },
            Status::kNotFinite},
           {[](System<kMaxDof>& s) { s.mass(0, 0) = -1; }, Status::kMassNotPositiveDefinite},
           {[](System<kMaxDof>& s) { s.mass(0, 1) += 0.1; }, Status::kNotSymmetric},
           {[](System<kMaxDof>& s) { s.damping.resize(2, 2); }, Status::kWrongSize},
           {[](System<kMaxDof>& s) { s.stiffness_factor.setConstant(kNan); },
            Status::kNotFinite}}) {
    System<kMaxDof> bad = good;
    change(bad);
    expect_failure(bad, status);
  }
  EXPECT_EQ(tracked.tracker->counters().failed, 7);
}

/// A spectrum is used again for the factor that it belongs to, and for no earlier one.
TEST(ModeTracker, ReusesASpectrumForItsOwnFactor) {
  const System<kMaxDof> first = panda_impedance(swing(0.1), 0.3);
  System<kMaxDof> second = first;
  second.stiffness_factor(2, 3) += 0.1;
  Tracked tracked;
  ASSERT_EQ(tracked.update(first), Status::kOk);
  ASSERT_EQ(tracked.update(second), Status::kOk);
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kTracked);
  ASSERT_EQ(tracked.update(second), Status::kOk);
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kReused);
  expect_enclosed(second, *tracked.spectrum);
  ASSERT_EQ(tracked.update(first), Status::kOk);
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kTracked);
  expect_enclosed(first, *tracked.spectrum);
  EXPECT_EQ(tracked.counters().reused, 1);
}

TEST(ModeTracker, ChangesSizes) {
  Random random(4004);
  Tracked tracked;
  for (const int n : {3, 7, 1, 16, 2}) {
    for (int call = 0; call < 2; ++call) {
      const System<kMaxDof> system = random_fixed_system(random, n, 1);
      ASSERT_EQ(tracked.update(system), Status::kOk);
      EXPECT_EQ(tracked.spectrum->mode_count, n);
      expect_enclosed(system, *tracked.spectrum);
    }
  }
  EXPECT_EQ(tracked.update(System<kMaxDof>(0)), Status::kOk);
  EXPECT_EQ(tracked.spectrum->mode_count, 0);
}

TEST(ModeTracker, FindsUndampedAndUnstableModes) {
  System<kMaxDof> system(2);
  system.stiffness.diagonal() << 4, 9;
  Tracked tracked;
  for (const double damping : {0.0, -0.2, 0.1}) {
    system.damping(0, 0) = damping;
    ASSERT_EQ(tracked.update(system), Status::kOk);
    EXPECT_EQ(tracked.mode(0).kind, ModeKind::kUndamped);
    EXPECT_EQ(tracked.mode(1).kind, damping == 0  ? ModeKind::kUndamped
                                    : damping < 0 ? ModeKind::kUnstable
                                                  : ModeKind::kUnderdamped);
    EXPECT_NEAR(tracked.mode(1).damping_ratio, damping / 4, 1e-15);
  }
}

TEST(ModeTracker, NeverProvesAMassThatIsNotPositiveDefinite) {
  // The mass slides into indefiniteness while everything else stands still.
  System<kMaxDof> system(2);
  system.stiffness.diagonal() << 4, 9;
  system.damping.diagonal() << 0.1, 0.1;
  Tracked tracked;
  for (int step = 0; step <= 100; ++step) {
    system.mass(0, 1) = system.mass(1, 0) = 0.5 + 0.01 * step;
    const Status status = tracked.update(system);
    if (system.mass(0, 1) < 0.995) {
      EXPECT_EQ(status, Status::kOk) << step;
    } else if (system.mass(0, 1) > 1.005) {
      EXPECT_EQ(status, Status::kMassNotPositiveDefinite) << step;
    }
  }
}

TEST(ModeTracker, RefusesOptionsThatMeanNothing) {
  TrackerOptions options;
  options.target_bound = 0;
  EXPECT_THROW(ModeTracker{options}, std::invalid_argument);
  options = {};
  options.max_iterations = 0;
  EXPECT_THROW(ModeTracker{options}, std::invalid_argument);
  options = {};
  options.soft_frequency = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(ModeTracker{options}, std::invalid_argument);
}

/// And by no more than it has to, where most of the bound is what the disturbance does.
TEST(TrackedEnclosure, OfAPerturbedBasisStillEncloses) {
  Random random(4005);
  int proved = 0;
  double tightest = 0;
  for (int trial = 0; trial < 600; ++trial) {
    const int n = random.integer(2, 7), rows = trial % 2 == 0 ? n - 1 : 0;
    System<kMaxDof> system = random_fixed_system(random, n, random.log_uniform(0.1, 30));
    if (rows > 0) system.stiffness_factor = 10 * random.matrix(rows, n);
    // An orthonormal basis of the space, from the true eigenvectors disturbed: found by a tracker
    // of a system that lies nearby.
    System<kMaxDof> nearby = system;
    const double size = random.log_uniform(1e-14, 1e-2);
    nearby.mass += size * random.spd(n);
    nearby.damping += size * random.spd(n);
    TrackerOptions options;
    options.target_bound = 1;
    options.max_iterations = 1;
    Tracked tracked(options);
    tracked.update(nearby);
    if (tracked.update(system) != Status::kOk) continue;
    ++proved;
    tightest = std::max(tightest, expect_enclosed(system, *tracked.spectrum).tightest);
    EXPECT_EQ(symmetric_pencil(system).zeros(), rows > 0 ? 1 : 0);
  }
  EXPECT_GE(proved, 500);
  EXPECT_GE(tightest, 0.01);
}

/// At the border of provable bounds, following fails before the direct solver, or the other way
/// round.
TEST(ModeTracker, SaysOkOnlyIfAllBoundsAreFinite) {
  constexpr int kModes = 6;
  Random random(4007);
  int uncertified = 0;
  for (double exponent = 9; exponent <= 14; exponent += 0.125) {
    SCOPED_TRACE(exponent);
    System<kMaxDof> system = random_fixed_system(random, kModes, 1);
    const MatrixXd V = Eigen::HouseholderQR<MatrixXd>(random.matrix(kModes, kModes)).householderQ();
    const Eigen::VectorXd masses =
        Eigen::VectorXd::LinSpaced(kModes, -exponent, 0).unaryExpr([](double power) {
          return std::pow(10, power);
        });
    const MatrixXd mass = V * masses.asDiagonal() * V.transpose();
    system.mass = 0.5 * (mass + mass.transpose());
    Tracked tracked;
    for (int update = 0; update < 2; ++update) {
      const Status status = tracked.update(system);
      bool all = true;
      for (int i = 0; i < tracked.spectrum->mode_count; ++i) {
        all = all && std::isfinite(tracked.mode(i).error_bound);
      }
      EXPECT_EQ(status, all ? Status::kOk : Status::kUncertified);
      uncertified += all ? 0 : 1;
      system.stiffness *= 1 + 1e-7;
    }
  }
  EXPECT_GT(uncertified, 0);
}

/// Any turn of the shapes by less than 45 degrees leaves every mode most like itself.
TEST(MatchedModes, KeepTheirIndicesIfTheirShapesTurn) {
  Random random(4006);
  for (int trial = 0; trial < 200; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const int n = random.integer(2, 8);
    MatrixXd turn = MatrixXd::Identity(n, n);
    for (int i = 0; i + 1 < n; i += 2) {  // pairs of modes, each by its own angle
      const double angle = random.uniform(-0.75, 0.75);
      turn.block(i, i, 2, 2) << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    }
    const auto system_of = [&](const MatrixXd& V, const Eigen::VectorXd& omega) {
      System<kMaxDof> system(n);
      const MatrixXd K = V * omega.cwiseAbs2().asDiagonal() * V.transpose();
      system.stiffness = 0.5 * (K + K.transpose());
      system.damping.diagonal().setConstant(0.3);
      return system;
    };
    const MatrixXd V = Eigen::HouseholderQR<MatrixXd>(random.matrix(n, n)).householderQ();
    Tracked tracked;
    ASSERT_EQ(tracked.update(system_of(V, Eigen::VectorXd::LinSpaced(n, 5.0 * n, 5))), Status::kOk);
    const MatrixXd turned = V * turn;
    tracked.tracker->reset();
    Eigen::VectorXd omega(n);  // in another order
    for (int i = 0; i < n; ++i) omega[i] = 7 + 5 * ((i + trial) % n);
    ASSERT_EQ(tracked.update(system_of(turned, omega)), Status::kOk);
    EXPECT_EQ(tracked.counters().direct, 2);
    EXPECT_EQ(tracked.spectrum->epoch, 1);
    for (int i = 0; i < n; ++i) EXPECT_NEAR(tracked.mode(i).natural_frequency, omega[i], 1e-9);
  }
}

}  // namespace
}  // namespace dashpot::analysis
