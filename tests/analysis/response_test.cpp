// Responses of systems made from known bases, without a solver: initial conditions, receptances and
// limits; response_oracle_test.cpp has the motions.
#include <dashpot/analysis/response.hpp>
#include <dashpot/tests/support/made_to_measure.hpp>
#include <dashpot/tests/support/matrices.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::MadeToMeasure;
using testing::near;

const VectorXd kNoForce = VectorXd::Zero(4);

class ResponseOf : public ::testing::TestWithParam<MadeToMeasure (*)(testing::Random&)> {
 protected:
  testing::Random random{31};
  MadeToMeasure made = GetParam()(random);
  Response response{made.system, made.spectrum};
};
INSTANTIATE_TEST_SUITE_P(Blocks, ResponseOf,
                         ::testing::Values(&testing::make_system_of_every_kind,
                                           &testing::make_defective_system),
                         [](const auto& instance) {
                           return instance.index == 0 ? "EveryKind" : "Defective";
                         });

TEST_P(ResponseOf, InitialConditionsAreMet) {
  for (int i = 0; i < 20; ++i) {
    const VectorXd q = random.vector(4), v = random.vector(4) * random.log_uniform(0.1, 100);
    const Motion motion = response.free(q, v, 0);
    const double size = q.norm() + v.norm();
    EXPECT_EQ(motion.position, q);  // to the last bit, and nearly so just after
    EXPECT_EQ(motion.velocity, v);
    EXPECT_TRUE(near(response.free(q, v, 1e-30).position, q, 1e-13 * size));
    EXPECT_TRUE(near(response.free(q, v, 1e-30).velocity, v, 1e-12 * size));
  }
  const VectorXd f = random.vector(4);
  const Motion struck = response.impulse(f, 0);
  EXPECT_TRUE(near(struck.velocity, made.system.mass.lu().solve(f), 1e-11));
  EXPECT_EQ(struck.position, kNoForce);
  EXPECT_TRUE(near(response.step(f, 0).position, kNoForce, 0));
  EXPECT_TRUE(near(response.step(f, 0).velocity, kNoForce, 0));
}

TEST_P(ResponseOf, ReceptanceInvertsTheDynamicStiffness) {
  const System<>& system = made.system;
  for (const double omega : {0.01, 1.0, 6.9, 12.0, 35.0, 1e3, 1e6}) {
    const MatrixXcd dynamic_stiffness =
        system.stiffness - omega * omega * system.mass + Complex(0, omega) * system.damping;
    const MatrixXcd H = response.receptance(omega);
    EXPECT_TRUE(near(H, dynamic_stiffness.fullPivLu().inverse(), 1e-9 * H.norm())) << omega;
  }
  const MatrixXcd H = response.receptance(0);  // of a zero mode
  EXPECT_TRUE((H.real().array() == std::numeric_limits<double>::infinity()).all());
}

/// One mass without spring: q'' + a q' = f.
Response free_mass(double a) {
  MatrixXd zero_mode(2, 2);
  zero_mode << 0, 1, 0, -a;
  MadeToMeasure made = testing::make_system(MatrixXd::Identity(1, 1),
                                            (MatrixXd(1, 2) << 1, 0).finished(), {zero_mode});
  made.spectrum.zero_modes.basis = MatrixXd::Identity(1, 1);
  return {made.system, made.spectrum};
}
VectorXd one(double value) {
  return VectorXd::Constant(1, value);
}

TEST(ResponseOfAFreeMass, PaperEq24DampedMotionComesToRest) {
  const Response response = free_mass(0.5);
  for (const double t : {1e-9, 0.1, 3.0, 1e6}) {
    const Motion motion = response.free(one(2), one(3), t);
    EXPECT_DOUBLE_EQ(motion.position(0), 2 - 3 * std::expm1(-0.5 * t) / 0.5);
    EXPECT_NEAR(motion.velocity(0), 3 * std::exp(-0.5 * t), 1e-15 * std::exp(-0.5 * t));
    EXPECT_DOUBLE_EQ(motion.zero_mode_position(0), motion.position(0));
    EXPECT_DOUBLE_EQ(motion.zero_mode_velocity(0), motion.velocity(0));
  }
}

/// q'' + 9 q = f: the undamped mode resonates at 3 rad/s.
Response resonator() {
  const MadeToMeasure made =
      testing::make_system(MatrixXd::Identity(1, 1), (MatrixXd(1, 2) << 1, 0).finished(),
                           {(MatrixXd(2, 2) << 0, 3, -3, 0).finished()});
  return {made.system, made.spectrum};
}

TEST(ResponseOfAResonator, IsInfiniteAtResonance) {
  const Response response = resonator();
  EXPECT_EQ(response.receptance(3)(0, 0).real(), std::numeric_limits<double>::infinity());
  const double omega = 3 + 0x1p-40, exact = -1 / ((omega - 3) * (omega + 3));
  EXPECT_NEAR(response.receptance(omega)(0, 0).real(), exact, 1e-14 * std::abs(exact));
  EXPECT_DOUBLE_EQ(response.receptance(0)(0, 0).real(), 1.0 / 9);
}

TEST(ResponseOfADampedZeroMode, IsInfiniteAtFrequencyZeroOnlyWhereAForceMovesIt) {
  System<> system(2);  // the second mass is held by nothing, and damped against the first
  system.mass.setIdentity();
  system.damping << 1, 0.5, 0.5, 1;
  system.stiffness << 1, 0, 0, 0;
  const MatrixXcd H = Response(system, analyze(system)).receptance(0);
  EXPECT_EQ(H(1, 1).real(), std::numeric_limits<double>::infinity());
  EXPECT_NEAR(std::abs(H(0, 0) - 1.0), 0, 1e-14);  // the limits of the exact inverse
  EXPECT_NEAR(std::abs(H(0, 1) + 0.5), 0, 1e-14);
  EXPECT_NEAR(std::abs(H(1, 0) + 0.5), 0, 1e-14);
}

TEST(Response, RefusesWrongSizesTimesAndSpectra) {
  const Response response = free_mass(1);
  const VectorXd two = VectorXd::Zero(2);
  EXPECT_THROW(response.free(two, one(0), 1), std::invalid_argument);
  EXPECT_THROW(response.free(one(0), two, 1), std::invalid_argument);
  EXPECT_THROW(response.impulse(one(0), -1), std::invalid_argument);
  EXPECT_THROW(response.step(two, 1), std::invalid_argument);
  EXPECT_THROW(response.step(one(0), std::nan("")), std::invalid_argument);
  EXPECT_THROW(response.step(one(std::nan("")), 1), std::invalid_argument);
  Spectrum<> failed;
  failed.status = Status::kNotConverged;
  EXPECT_THROW(Response(System<>(1), failed), std::invalid_argument);
  EXPECT_THROW(Response(System<>(1), Spectrum<>()), std::invalid_argument);
}

TEST(Response, OfASystemWithoutCoordinatesIsEmpty) {
  Spectrum<> spectrum;
  spectrum.basis.U.resize(0, 0);
  spectrum.zero_modes.basis.resize(0, 0);
  const Response response(System<>(0), spectrum);
  EXPECT_EQ(response.free(VectorXd(0), VectorXd(0), 1).position.size(), 0);
  EXPECT_EQ(response.receptance(1).size(), 0);
}

}  // namespace
}  // namespace dashpot::analysis
