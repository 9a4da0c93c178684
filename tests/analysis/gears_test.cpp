// Elastic joints in joint coordinates: refusals, and the level of a damping design.
#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/analysis/gears.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNoBend = std::numeric_limits<double>::infinity();

Gears::Data gears_of_two() {
  return {VectorXd::Constant(2, 2000), VectorXd::Constant(2, 2), VectorXd::Constant(2, 0.4),
          MatrixXd(VectorXd::Constant(2, 0.5).asDiagonal()), false};
}

TEST(Gears, NameTheNumberOfJointsThatCanBeElastic) {
  const Gears::Data many{VectorXd::Constant(10, 1e4), VectorXd::Zero(10), VectorXd::Ones(10), {}};
  try {
    const Gears gears(many);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "gears: 10 joints, of which at most 6 can be elastic");
  }
  Gears::Data some = many;
  some.stiffness.head(4).setConstant(kNoBend);
  EXPECT_EQ(Gears(some).coordinates(), 16);
  some.inertia[9] = 0;
  EXPECT_THROW(Gears{some}, std::invalid_argument);
  some.inertia.head(4).setZero();  // of rigid joints none is needed
  some.inertia[9] = 1;
  EXPECT_EQ(Gears(some).count(), 6);
  some.damping[5] = -1;
  EXPECT_THROW(Gears{some}, std::invalid_argument);
}

TEST(Gears, AreNoneWhereAllAreRigid) {
  Gears::Data data = gears_of_two();
  data.stiffness.setConstant(kNoBend);
  EXPECT_FALSE(Gears(data).any());
  EXPECT_FALSE(Gears().any());
}

/// Two joints with springs, undamped, and what the loop is.
struct GearedJoints {
  TaskImpedance impedance;
  LoopLimit limit;
};

GearedJoints geared_joints(bool link) {
  GearedJoints result;
  TaskImpedance& impedance = result.impedance;
  impedance.mass = (MatrixXd(2, 2) << 1.6, 0.3, 0.3, 0.9).finished();
  impedance.stiffness = MatrixXd(VectorXd::Constant(2, 120).asDiagonal());
  Gears::Data data = gears_of_two();
  data.link_sensor = link;
  impedance.damping = data.friction;
  result.limit.loop.friction = data.friction;
  result.limit.loop.gears = Gears(data);
  return result;
}

// A design with gears in joint coordinates has the margin of the loop with its motors.
TEST(Gears, LowerADesignToWhatTheLoopBears) {
  const DampingTarget target = DampingTarget::constant(0.7);
  for (const bool link : {false, true}) {
    SCOPED_TRACE(link);
    GearedJoints with = geared_joints(link);
    GearedJoints rigid = with;
    rigid.limit.loop.gears = {};
    const SampledDamping without = design_damping(rigid.impedance, target, rigid.limit);
    EXPECT_EQ(without.level, 1);
    EXPECT_GT(without.gain_margin, 10);
    const SampledDamping found = design_damping(with.impedance, target, with.limit);
    ASSERT_TRUE(found.kept);
    if (link) {
      EXPECT_LT(found.level, 0.9);
      EXPECT_NEAR(found.gain_margin, 2, 1e-4);
    } else {
      EXPECT_EQ(found.level, 1);
    }
    System<> system = found.design.system;
    with.limit.loop.gears.extend(system);
    const SampledLoop loop = with_gears(with.limit.loop);
    EXPECT_FALSE(loop.gears.any());
    const Spectrum<> spectrum = analyze(system);
    EXPECT_NEAR(gain_margin(system, spectrum, loop), found.gain_margin, 1e-5 * found.gain_margin);
    ASSERT_EQ(found.sampled.modes.size(), 4u);
    const SampledSpectrum sampled = sample_loop(system, spectrum, loop);
    EXPECT_EQ(sampled.spectral_radius, found.sampled.spectral_radius);
    EXPECT_LT(sampled.spectral_radius, 1);
    EXPECT_TRUE(keeps_margin(system, spectrum, loop, 0.99 * found.gain_margin));
    EXPECT_FALSE(keeps_margin(system, spectrum, loop, 1.01 * found.gain_margin));
  }
}

// Gravity acts on the links, and is compensated where the motors are: a zero mode does not rest.
TEST(Gears, LeaveAPartOfGravityWhereTheyBend) {
  System<> system(2);
  system.mass = (MatrixXd(2, 2) << 1.6, 0.3, 0.3, 0.9).finished();
  system.stiffness = MatrixXd(Eigen::Vector2d(120, 0).asDiagonal());
  system.damping = MatrixXd(Eigen::Vector2d(15, 1).asDiagonal());
  Gears::Data data = gears_of_two();
  data.friction.resize(0, 0);
  SampledLoop loop;
  loop.gears = Gears(data);
  const Spectrum<> spectrum = analyze(system);
  EXPECT_LE(sample_loop(system, spectrum, loop).spectral_radius, 1 - 1e-6);
  loop.gravity_gradient = MatrixXd(Eigen::Vector2d(0, -40).asDiagonal());  // hangs upside down
  // It is held back by 40 at the motor and pushed by 40 at the link: 40^2 / 2000 N m/rad are left.
  const double grows = 40.0 * 40 / 2000;
  const SampledSpectrum sampled = sample_loop(system, spectrum, loop);
  const double rate = std::log(sampled.spectral_radius) / loop.period;
  EXPECT_GT(rate, 0.5 * grows / 1);  // against a damping of 1 N m s/rad
  EXPECT_LT(rate, grows / 1);
}

}  // namespace
}  // namespace dashpot::analysis
