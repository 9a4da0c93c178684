// Systems that the tracker does not follow, but solves directly, and modes without a motion.
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace dashpot::analysis {
namespace {

using testing::Tracked;

/// The modes turn into each other's places within 90 degrees; each solution is compared with the
/// last one, not with that of the symmetric start.
TEST(ModeTracker, KeepsThePlacesOfModesThatItSolvesDirectly) {
  Tracked tracked;
  for (int degrees = 0; degrees <= 90; degrees += 5) {
    const double angle = degrees * std::numbers::pi / 180;
    const Eigen::Rotation2Dd turn(angle);
    System<kMaxDof> system(2);
    system.stiffness = turn.toRotationMatrix() * Eigen::Vector2d(100, 400).asDiagonal() *
                       turn.toRotationMatrix().transpose();
    system.stiffness = (0.5 * (system.stiffness + system.stiffness.transpose())).eval();
    system.damping.diagonal().setConstant(0.1);
    if (degrees > 0) system.damping(0, 1) = 1e-3, system.damping(1, 0) = -1e-3;
    ASSERT_EQ(tracked.update(system), Status::kOk);
    EXPECT_EQ(tracked.spectrum->epoch, 1);
    EXPECT_NEAR(tracked.mode(0).natural_frequency, 20, 1e-3) << degrees;
    EXPECT_NEAR(tracked.mode(1).natural_frequency, 10, 1e-3) << degrees;
    for (int i = 0; degrees > 0 && i < 2; ++i) {
      EXPECT_EQ(tracked.spectrum->shapes[static_cast<std::size_t>(i)].slope[0], Complex());
    }
  }
}

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

TEST(ModeTracker, SolvesASingularStiffnessWithoutFactorDirectly) {
  System<kMaxDof> system(2);
  system.stiffness << 4, -4, -4, 4;
  system.damping << 0.4, -0.4, -0.4, 0.4;
  Tracked tracked;
  for (int call = 0; call < 3; ++call) {
    EXPECT_EQ(tracked.update(system), Status::kOk);
    EXPECT_EQ(tracked.spectrum->origin, SpectrumOrigin::kDirect);
    ASSERT_EQ(tracked.spectrum->mode_count, 1);
    EXPECT_EQ(tracked.spectrum->zero_mode_count, 1);
    EXPECT_NEAR(tracked.mode(0).natural_frequency, std::sqrt(8.0), 1e-14);
  }
}

}  // namespace
}  // namespace dashpot::analysis
