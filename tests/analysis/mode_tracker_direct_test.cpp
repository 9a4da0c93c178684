// Systems that the tracker does not follow, but solves directly, and modes without a motion.
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace dashpot::analysis {
namespace {

using testing::Random;
using testing::Tracked;

/// A spring that no motion extends has an eigenvalue of zero, and no shape.
TEST(ModeTracker, HasNoShapeWhereNothingMoves) {
  for (const double coupling : {0.0, 0.05}) {
    System<kMaxDof> system(2);
    system.stiffness_factor.resize(2, 2);
    system.stiffness_factor << 10, 0, 0, 0;
    system.damping << 0.2, coupling, coupling, 0.3;
    Tracked tracked;
    for (int call = 0; call < 3; ++call) {
      system.stiffness_factor(0, 0) += 1e-3;
      ASSERT_EQ(tracked.update(system), Status::kOk);
      ASSERT_EQ(tracked.spectrum->mode_count, 2);
      int still = 0;
      for (const TrackedShapes& shapes :
           {tracked.spectrum->shapes[0], tracked.spectrum->shapes[1]}) {
        for (std::size_t k = 0; k < 2; ++k) {
          ASSERT_TRUE(shapes.u[k].allFinite()) << "call " << call;
          EXPECT_TRUE(std::isfinite(std::abs(shapes.slope[k])));
          const double energy = std::real(
              Complex(shapes.u[k].dot(ComplexVector<kMaxDof>(system.mass * shapes.u[k]))));
          if (energy == 0) {
            ++still;
          } else {
            EXPECT_NEAR(energy, 1, 1e-12);
          }
        }
      }
      EXPECT_EQ(still, 1);
    }
  }
}

/// A defective eigenvalue of three modes is solved directly. The same system has the same spectrum,
/// whatever order another solution might find the modes in.
TEST(ModeTracker, PublishesAgainWhatItCannotFollow) {
  System<kMaxDof> system(3);
  system.damping.diagonal().setConstant(0.2);
  system.stiffness << 4, 1, 0, 0, 4, 1, 0, 0, 4;
  Tracked tracked;
  const Status status = tracked.update(system);
  ASSERT_TRUE(status == Status::kOk || status == Status::kUncertified) << to_text(status);
  ASSERT_FALSE(tracked.tracker->follows());
  const TrackedSpectrum first = *tracked.spectrum;
  EXPECT_EQ(first.origin, SpectrumOrigin::kDirect);
  for (int call = 0; call < 2; ++call) {
    ASSERT_EQ(tracked.update(system), status);
    EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kReused);
    EXPECT_EQ(tracked.spectrum->epoch, first.epoch);
    EXPECT_EQ(tracked.spectrum->mode_count, first.mode_count);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(tracked.spectrum->modes[i].eigenvalues, first.modes[i].eigenvalues);
      EXPECT_EQ(tracked.spectrum->order[i], first.order[i]);
    }
  }
  EXPECT_EQ(tracked.counters().reused, 2);
  tracked.tracker->reset();
  tracked.update(system);
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kDirect);
  system.damping(0, 0) = 0.3;
  tracked.update(system);
  EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kDirect);
}

/// Nonsymmetric damping of a spring and two zero modes can leave two complex pairs: a mode more
/// than the stiffness factor has rows, and two zero modes as well.
TEST(ModeTracker, HasRoomForModesThatDampingMakesOfZeroModes) {
  testing::Random random(431);
  System<kMaxDof> system(16);
  system.stiffness_factor.setZero(14, 16);
  system.damping.diagonal().setConstant(0.1);
  for (Eigen::Index i = 0; i < 14; ++i) {
    system.stiffness_factor(i, i) = i < 13 ? 10 + static_cast<double>(i) : 3;
  }
  int found = 0;
  for (int trial = 0; trial < 50; ++trial) {
    system.damping.bottomRightCorner(3, 3) = 10 * random.matrix(3, 3);
    Tracked tracked;
    for (int call = 0; call < 3; ++call) {
      system.stiffness_factor(0, 0) += 1e-3;
      const Status status = tracked.update(system);
      ASSERT_TRUE(status == Status::kOk || status == Status::kUncertified) << to_text(status);
      if (tracked.spectrum->mode_count != 15) break;
      ++found;
      for (int i = 0; i < 13; ++i) {
        bool known = false;
        for (int k = 0; k < 15; ++k) {
          const double frequency = tracked.mode(k).natural_frequency;
          known |= std::abs(frequency - system.stiffness_factor(i, i)) < 1e-9;
        }
        EXPECT_TRUE(known) << i;
      }
    }
  }
  EXPECT_GT(found, 3);
}

/// C = d A with a large d: slow eigenvalues are near the eigenvalues of -A^-1 K / d, -2 / d and
/// -10 / (3 d), and fast ones near the eigenvalues of -d A.
TEST(ModeTracker, KeepsTheSlowEigenvaluesOfHeavilyOverdampedModes) {
  for (const double d : {1e4, 1e5, 1e8}) {
    SCOPED_TRACE(d);
    System<kMaxDof> system(2);
    system.stiffness << 2, 1, 1, 3;
    Tracked tracked;
    for (int call = 0; call < 3; ++call) {
      const double damping = d * (1 + 1e-6 * call);
      system.damping << damping, 0.5 * damping, 0.5 * damping, damping;
      ASSERT_EQ(tracked.update(system), Status::kOk);
      std::array<double, 2> slow{};
      for (int i = 0; i < 2; ++i) {
        const ModeNumbers& mode = tracked.mode(i);
        slow[static_cast<std::size_t>(i)] = -mode.eigenvalues[0].real() * damping;
        EXPECT_EQ(mode.kind, ModeKind::kOverdamped);
        EXPECT_LE(mode.natural_frequency_bound, 1e-6 * mode.natural_frequency);
        EXPECT_LE(mode.damping_ratio_bound, 1e-6 * mode.damping_ratio);
        const double product = (mode.eigenvalues[0] * mode.eigenvalues[1]).real();
        EXPECT_NEAR(mode.natural_frequency, std::sqrt(product), 1e-6);
      }
      std::sort(slow.begin(), slow.end());
      EXPECT_NEAR(slow[0], 2, 1e-6);
      EXPECT_NEAR(slow[1], 10.0 / 3, 1e-6);
    }
  }
}

/// Underflow is not counted below 1e-60 rad/s.
TEST(ModeTracker, ProvesNothingOfVibrationsThatAreTooSlow) {
  for (const double frequency : {1e-50, 1e-65, 1e-90, 1e-150}) {
    SCOPED_TRACE(frequency);
    System<kMaxDof> system(2);
    system.stiffness_factor.resize(2, 2);
    TrackerOptions options;
    options.soft_frequency = 0;
    Tracked tracked(options);
    for (int call = 0; call < 3; ++call) {
      system.stiffness_factor << frequency, 0, 0, 3 * frequency * (1 + 1e-5 * call);
      const Status status = tracked.update(system);
      if (frequency < 1e-100) {  // nothing can be computed
        EXPECT_EQ(status, Status::kOverflow);
        EXPECT_EQ(tracked.spectrum->mode_count, 0);
        continue;
      }
      ASSERT_EQ(status, frequency > 1e-60 ? Status::kOk : Status::kUncertified);
      for (int i = 0; i < tracked.spectrum->mode_count; ++i) {
        EXPECT_EQ(std::isfinite(tracked.mode(i).error_bound), frequency > 1e-60) << call;
      }
    }
  }
}

TEST(ModeTracker, FollowsASingularStiffnessWithoutFactor) {
  System<kMaxDof> system(2);
  system.stiffness << 4, -4, -4, 4;
  system.damping << 0.4, -0.4, -0.4, 0.4;
  Tracked tracked;
  for (int call = 0; call < 3; ++call) {
    system.damping *= 1 + 0.01 * call;
    EXPECT_EQ(tracked.update(system), Status::kOk);
    EXPECT_EQ(tracked.spectrum->origin,
              call == 0 ? SpectrumOrigin::kDirect : SpectrumOrigin::kTracked);
    ASSERT_EQ(tracked.spectrum->mode_count, 1);
    EXPECT_EQ(tracked.spectrum->zero_mode_count, 1);
    EXPECT_NEAR(tracked.spectrum->zero_mode_rates[0], 0, 1e-14);
    EXPECT_NEAR(tracked.mode(0).natural_frequency, std::sqrt(8.0), 1e-14);
    // Symmetric all the same: u'(2 l M + C) u, with u = (1, -1) / sqrt(2).
    const Complex slope = 2.0 * tracked.mode(0).eigenvalues[0] + 2 * system.damping(0, 0);
    EXPECT_LE(std::abs(tracked.spectrum->shapes[0].slope[0] - slope), 1e-13);
  }
}

/// A system whose coefficients have errors is solved directly at each call, whether it changes or
/// is the same to the last bit: that these bounds count the errors is in
/// coefficient_errors_test.cpp.
TEST(ModeTracker, SolvesSystemsWithErrorsDirectly) {
  Random random(2310);
  for (const auto error : {&System<kMaxDof>::mass_error, &System<kMaxDof>::damping_error,
                           &System<kMaxDof>::stiffness_error}) {
    System<kMaxDof> system(3);
    system.mass = random.spd(3);
    system.damping = 5 * random.spd(3);
    system.stiffness = 2500 * random.spd(3);
    Tracked tracked;
    ASSERT_EQ(tracked.update(system), Status::kOk);  // so that there is a basis to follow
    const double before = tracked.mode(0).error_bound;
    system.*error = Eigen::MatrixXd::Constant(3, 3, 1e-6);
    for (int call = 0; call < 3; ++call) {
      if (call == 2) system.damping(0, 0) *= 1 + 1e-12;
      ASSERT_EQ(tracked.update(system), Status::kOk);
      EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kDirect);
      EXPECT_GT(tracked.mode(0).error_bound, 1e3 * before);
    }
  }
  System<kMaxDof> wrong(3);
  wrong.mass_error = Eigen::MatrixXd::Ones(2, 2);
  EXPECT_EQ(Tracked().update(wrong), Status::kWrongSize);
}

}  // namespace
}  // namespace dashpot::analysis
