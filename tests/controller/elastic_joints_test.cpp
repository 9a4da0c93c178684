// Elastic joints: in the modes of the tick, and at a posture. The sampled loop with them is in
// tests/sim/elastic_prediction_test.cpp.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/core/gears_stop.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/led_arm.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;
using testing::LedArm;

const double kInfinite = std::numeric_limits<double>::infinity();

/// The motors of an arm, and the data of its gears.
ModelOptions gears(int n, double stiffness, PositionSensor sensor, double damping_ratio = 0.01) {
  ModelOptions options;
  options.viscous_friction = JointVector::LinSpaced(n, 0.5, 0.2);
  options.reflected_inertia = JointVector::LinSpaced(n, 0.6, 0.2);
  options.gear_stiffness = stiffness * JointVector::LinSpaced(n, 1, 0.3);
  options.gear_damping = 2 * damping_ratio *
                         options.gear_stiffness.cwiseProduct(options.reflected_inertia).cwiseSqrt();
  options.position_sensor = sensor;
  return options;
}

/// Settings without limits, and with a brake that these gears tolerate.
Settings settings_of(const RobotModel& model, Mode mode) {
  Settings settings = testing::in_mode(testing::unlimited_settings(model), mode);
  settings.limits.stopping_time = 1;
  settings.limits.position_upper.setConstant(kInfinite);
  settings.limits.position_lower.setConstant(-kInfinite);
  return settings;
}

/// The textbook's matrices of an arm, all of whose joints are elastic: links first.
struct Matrices {
  MatrixXd M, C, K;
};

/// Makes the matrices from what the controller feeds back, K_c and C_c, and motor-side friction.
Matrices textbook(const RobotModel& model, const JointVector& q, const MatrixXd& K_c,
                  const MatrixXd& C_c) {
  const Index n = q.size();
  const auto values = [&](double Joint::*property) -> MatrixXd {
    return VectorXd(model.joint_values(property)).asDiagonal();
  };
  const MatrixXd B = values(&Joint::reflected_inertia), K_J = values(&Joint::gear_stiffness),
                 D_J = values(&Joint::gear_damping), F = values(&Joint::viscous_friction);
  Matrices out{MatrixXd::Zero(2 * n, 2 * n), MatrixXd(2 * n, 2 * n), MatrixXd(2 * n, 2 * n)};
  out.M.topLeftCorner(n, n) = MatrixXd(evaluate(model, q, JointVector::Zero(n)).M) - B;
  out.M.bottomRightCorner(n, n) = B;
  const bool link = model.position_sensor() == PositionSensor::kLink;
  const MatrixXd none = MatrixXd::Zero(n, n);
  out.K << K_J, -K_J, (link ? K_c : none) - K_J, K_J + (link ? none : K_c);
  out.C << D_J, -D_J, (link ? C_c : none) - D_J, D_J + F + (link ? none : C_c);
  return out;
}

VectorXcd eigenvalues_of(const Matrices& loop) {
  const Index n = loop.M.rows();
  MatrixXd A = MatrixXd::Zero(2 * n, 2 * n);
  A.topRightCorner(n, n).setIdentity();
  A.bottomLeftCorner(n, n) = -loop.M.partialPivLu().solve(loop.K);
  A.bottomRightCorner(n, n) = -loop.M.partialPivLu().solve(loop.C);
  return Eigen::EigenSolver<MatrixXd>(A, false).eigenvalues();
}

/// Springs and dampers of the gains with the textbook's null space, away from singularities.
Matrices springs_of(const RobotModel& model, const Gains& gains, Mode mode, const JointVector& q) {
  if (mode == Mode::kJoint) return {{}, gains.joint_damping, gains.joint_stiffness};
  const auto robot = evaluate(model, q, JointVector::Zero(q.size()));
  const MatrixXd M = robot.M, J = robot.J, W = M.inverse();
  MatrixXd K = J.transpose() * gains.task_stiffness * J;
  MatrixXd C = J.transpose() * gains.task_damping * J;
  if (q.size() > 6) {
    const MatrixXd N = MatrixXd::Identity(q.size(), q.size()) -
                       W * J.transpose() * (J * W * J.transpose()).inverse() * J;
    K += N.transpose() * gains.null_stiffness.asDiagonal() * N;
    C += N.transpose() * gains.null_damping.asDiagonal() * N;
  }
  return {{}, C, K};
}

/// The largest distance of an eigenvalue from the nearest true one beyond its proved bound,
/// relative to it and to a millionth of the largest. Each true one counts once.
double worst_error(const Vibration& found, VectorXcd truth) {
  const double largest = truth.cwiseAbs().maxCoeff();
  double worst = 0;
  for (int i = 0; i < found.count; ++i) {
    for (const analysis::Complex& value : found.modes[testing::at(i)].eigenvalues) {
      Index nearest = 0;
      const double distance = (truth.array() - value).abs().minCoeff(&nearest);
      worst = std::max(worst, distance / (std::abs(value) + 1e-6 * largest));
      truth[nearest] = 1e300;
    }
  }
  return worst;
}

// Independent values: dense eigenvalues of the state matrix of 28 (24) states from the textbook's
// blocks. The modes are tracked while the arm swings.
TEST(ElasticJoints, HaveTheModesOfTheTextbookAtEveryTick) {
  for (const testing::Arm& arm : testing::arms()) {
    if (std::string(arm.file) == "baxter_left") continue;  // its null space is nearly singular
    const int n = testing::arm_model(arm).dof();
    for (const PositionSensor sensor : {PositionSensor::kMotor, PositionSensor::kLink}) {
      for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
        SCOPED_TRACE(std::string(arm.file) +
                     (sensor == PositionSensor::kLink ? " link" : " motor") +
                     (mode == Mode::kJoint ? " joint" : " cartesian"));
        const RobotModel model = testing::arm_model(arm, gears(n, 1e4, sensor));
        const Settings settings = settings_of(model, mode);
        LedArm led(model, settings, testing::kSmallSwing);
        led.settle();
        for (int k = 0; k < 500'000 && led.modes().count == 0; ++k) {
          led.tick();
        }
        for (int k = 1; k <= 300; ++k) {
          led.swing(1e-3 * k);
          Status status = Status::kOk;
          ASSERT_EQ(testing::allocations_of([&] { status = led.tick(); }), 0);
          ASSERT_LE(status, Status::kTorqueLimited);
          const Vibration& modes = led.modes();
          if (modes.status == analysis::Status::kUnfinished) continue;  // another thread is at work
          ASSERT_EQ(modes.status, analysis::Status::kOk) << k;
          ASSERT_EQ(modes.count, 2 * n);
          ASSERT_EQ(modes.modes[0].shape.size(), 2 * n);
          if (k % 50 != 0) continue;
          const Matrices springs =
              springs_of(model, settings.initial.gains, mode, led.state.position);
          const Matrices truth = textbook(model, led.state.position, springs.K, springs.C);
          EXPECT_LE(worst_error(modes, eigenvalues_of(truth)), 1e-8) << k;
          for (int i = 0; i < modes.count; ++i) {
            const VibrationMode& mode_i = modes.modes[testing::at(i)];
            EXPECT_LE(mode_i.error_bound, 1e-6 * std::abs(mode_i.eigenvalues[1])) << i;
          }
        }
        const VibrationCounters& counters = led.modes().counters;
        EXPECT_GE(counters.tracked, 280u);
        EXPECT_EQ(counters.failed + counters.missed, 0u);
      }
    }
  }
}

// Without posture springs one motion of the Panda has no spring: links and motors together.
TEST(ElasticJoints, LeaveTheZeroModesOfTheArm) {
  for (const PositionSensor sensor : {PositionSensor::kMotor, PositionSensor::kLink}) {
    const RobotModel model = testing::arm_model(testing::arms()[0], gears(7, 1e4, sensor));
    Settings settings = settings_of(model, Mode::kCartesian);
    settings.initial.gains.null_stiffness.setZero();
    LedArm led(model, settings, testing::kSmallSwing);
    led.settle();
    for (int k = 1; k <= 100; ++k) {
      led.swing(1e-3 * k);
      led.tick();
      ASSERT_EQ(led.modes().status, analysis::Status::kOk);
      ASSERT_EQ(led.modes().zero_modes, 1) << k;
      ASSERT_EQ(led.modes().count, 13) << k;
    }
  }
}

/// One joint, whose link has an inertia of 0.5 kg m^2.
RobotModel one_joint(const ModelOptions& options) {
  return RobotModel::from_urdf_text(
      "<robot name='r'><link name='a'/><link name='b'><inertial><mass value='1'/><inertia "
      "ixx='0.5' iyy='0.5' izz='0.5' ixy='0' ixz='0' iyz='0'/></inertial></link><joint name='j' "
      "type='continuous'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint></robot>",
      "a", "b", options);
}

/// The system of a joint spring and damper.
analysis::System<kMaxJoints> joint_loop(const RobotModel& model, double stiffness,
                                        double damping = 0) {
  Settings settings = default_settings(model);
  settings.limits.gain_margin = 1;
  Gains gains = settings.initial.gains;
  gains.joint_damping_ratio = 0;
  gains.joint_stiffness = JointVector::Constant(model.dof(), stiffness).asDiagonal();
  gains.joint_damping = JointVector::Constant(model.dof(), damping).asDiagonal();
  analysis::System<kMaxJoints> system;
  PostureLoop loop(model, settings);
  EXPECT_EQ(loop.closed_loop(JointVector::Zero(model.dof()), gains, Mode::kJoint, system),
            Status::kOk);
  return system;
}

std::vector<double> frequencies_of(const analysis::System<kMaxJoints>& system) {
  analysis::SpectrumSolver<kMaxJoints> solver;
  analysis::Spectrum<kMaxJoints> spectrum;
  EXPECT_EQ(solver.solve(system, spectrum), analysis::Status::kOk);
  std::vector<double> result;
  for (const auto& mode : spectrum.modes) result.push_back(mode.natural_frequency);
  return result;
}

// m q'' = -k (q - theta), b theta'' = -k (theta - q) - c theta: the squares of the frequencies are
// the roots of m b x^2 - ((m + b) k + m c) x + c k. With the link measured c pulls at q, and
// b theta'' = -k (theta - q) - c q, of which the product of the roots is the same and the sum less.
TEST(ElasticJoints, AreTwoMassesOnASpring) {
  const double m = 0.5, b = 0.3, k = 4000, c = 700;
  ModelOptions options = gears(1, k, PositionSensor::kMotor, 0);
  options.viscous_friction.setZero();
  options.reflected_inertia.setConstant(b);
  options.gear_stiffness.setConstant(k);
  for (const bool link : {false, true}) {
    options.position_sensor = link ? PositionSensor::kLink : PositionSensor::kMotor;
    const auto found = frequencies_of(joint_loop(one_joint(options), c));
    const double sum = ((m + b) * k + (link ? 0 : m * c)) / (m * b), product = c * k / (m * b);
    const double root = std::sqrt(0.25 * sum * sum - product);
    ASSERT_EQ(found.size(), 2u);
    EXPECT_NEAR(found[0], std::sqrt(0.5 * sum + root), 1e-11 * found[0]);
    EXPECT_NEAR(found[1], std::sqrt(0.5 * sum - root), 1e-11 * found[1]);
  }
}

// With a brake d q' on the link, B J s^3 + (B + J) D s^2 + ((B + J) K + d D) s + d K = 0 has its
// boundary, by Routh, at d B J K = (B + J) D ((B + J) K + d D).
TEST(ElasticJoints, AreStoppedByABrakeThatTheyBear) {
  const double J = 0.5, B = 0.3, K = 4000;
  ModelOptions options = gears(1, K, PositionSensor::kLink);
  options.viscous_friction.setZero();
  options.reflected_inertia.setConstant(B);
  options.gear_stiffness.setConstant(K);
  for (const double D : {0.3, 1.0, 4.0}) {
    options.gear_damping.setConstant(D);
    const double d = (B + J) * (B + J) * D * K / (B * J * K - (B + J) * D * D);
    const double T = 2 * (B + J) / d;  // with a margin of 2
    options.position_sensor = PositionSensor::kLink;
    const RobotModel link = one_joint(options);
    options.position_sensor = PositionSensor::kMotor;
    const RobotModel motor = one_joint(options);
    Settings settings = default_settings(link);
    settings.period = 1e-6;  // no delay to speak of
    settings.limits.beyond_model = true;
    settings.limits.stopping_time = 10;
    EXPECT_NEAR(gears_stopping_time(link, settings, 2 * T), T, 1e-4 * T) << D;
    EXPECT_DOUBLE_EQ(gears_stopping_time(link, settings, 100 * T), 20 * T) << D;
    EXPECT_DOUBLE_EQ(gears_stopping_time(motor, settings, 0.01), 0.002) << D;
    try {
      (void)gears_stopping_time(link, settings, 0.9 * T);
      ADD_FAILURE() << "a brake that the gears do not tolerate, " << D;
    } catch (const InvalidSettings& refused) {
      EXPECT_THAT(refused.what(), ::testing::HasSubstr("keeps a gain margin of 2 from "));
    }
  }
  options.gear_damping.setZero();
  options.position_sensor = PositionSensor::kLink;
  const RobotModel undamped = one_joint(options);
  EXPECT_THAT([&] { (void)Controller(undamped, default_settings(undamped)); },
              ::testing::ThrowsMessage<InvalidSettings>(
                  ::testing::HasSubstr("no brake is stable: their damping is too small")));
  const RobotModel rigid = testing::panda_model();
  EXPECT_EQ(gears_stopping_time(rigid, default_settings(rigid), 0.05), 0);
}

TEST(ElasticJoints, MayBeSomeOfTheJoints) {
  ModelOptions options = gears(7, 1e4, PositionSensor::kMotor, 0);
  for (const Index rigid : {1, 4, 5}) options.gear_stiffness[rigid] = kInfinite;
  const RobotModel some = testing::arm_model(testing::arms()[0], options);
  for (const Index rigid : {1, 4, 5}) options.gear_stiffness[rigid] = 1e9;
  const RobotModel all = testing::arm_model(testing::arms()[0], options);
  const auto found = frequencies_of(joint_loop(some, 500, 10));
  const auto nearly = frequencies_of(joint_loop(all, 500, 10));
  ASSERT_EQ(found.size(), 11u);
  ASSERT_EQ(nearly.size(), 14u);
  for (std::size_t i = 0; i < 11; ++i) EXPECT_NEAR(found[i], nearly[i + 3], 1e-4 * found[i]) << i;
}

/// The loop of a controller with the same gains at rest.
TEST(ElasticJoints, AreTheSameAtAPostureAndInAController) {
  for (const PositionSensor sensor : {PositionSensor::kMotor, PositionSensor::kLink}) {
    for (const bool outside : {false, true}) {
      const RobotModel model = testing::arm_model(testing::arms()[0], gears(7, 1e4, sensor));
      Settings settings = settings_of(model, Mode::kCartesian);
      if (outside) settings.environment.tip_stiffness.setConstant(300);
      if (outside) settings.environment.joint_damping.setConstant(7, 0.4);
      LedArm led(model, settings);
      led.settle();
      analysis::System<kMaxJoints> here, there;
      led.controller.closed_loop(here);
      PostureLoop posture(model, settings);
      ASSERT_EQ(posture.closed_loop(led.center, settings.initial.gains, Mode::kCartesian, there),
                Status::kOk);
      EXPECT_LE((here.stiffness - there.stiffness).norm(), 1e-9 * there.stiffness.norm());
      EXPECT_LE((here.damping - there.damping).norm(), 1e-9 * there.damping.norm());
      EXPECT_LE(worst_error(led.modes(), eigenvalues_of({here.mass, here.damping, here.stiffness})),
                1e-8);
      const Matrices springs =
          springs_of(model, settings.initial.gains, Mode::kCartesian, led.center);
      Matrices wanted = textbook(model, led.center, springs.K, springs.C);
      if (outside) {  // it acts on the links, whatever is measured
        const MatrixXd J = evaluate(model, led.center, JointVector::Zero(7)).J;
        wanted.K.topLeftCorner(7, 7) += 300 * J.transpose() * J;
        wanted.C.topLeftCorner(7, 7).diagonal().array() += 0.4;
      }
      EXPECT_LE((here.mass - wanted.M).norm(), 1e-12 * wanted.M.norm());
      EXPECT_LE((here.stiffness - wanted.K).norm(), 1e-9 * wanted.K.norm());
      EXPECT_LE((here.damping - wanted.C).norm(), 1e-9 * wanted.C.norm());
    }
  }
}

}  // namespace
}  // namespace dashpot::controller
