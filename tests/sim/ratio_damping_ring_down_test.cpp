// A damping ratio that the controller holds, seen in small releases of the simulated arm: along a
// straight way of the tip, where a constant damping matrix drifts, and in the joint mode.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/tests/support/released_arm.hpp>

#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

namespace dashpot {
namespace {

using controller::JointVector;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Random;
using testing::ReleasedArm;
using testing::TwinModels;

constexpr double kRatio = 0.7;

/// Postures along a straight way of the tip with its orientation kept; `twist` is the whole way.
std::vector<JointVector> straight_way(const TwinModels& twin, JointVector q, VectorXd twist,
                                      int points) {
  constexpr int kSteps = 200;
  std::vector<JointVector> way = {q};
  for (int k = 1; k < points; ++k) {
    for (int i = 0; i < kSteps; ++i) {
      const auto robot = evaluate(twin.model, q, JointVector::Zero(q.size()));
      const MatrixXd M = robot.M, J = robot.J, X = M.llt().solve(J.transpose());
      q += X * (J * X).llt().solve(twist / (kSteps * (points - 1)));
    }
    way.push_back(q);
  }
  return way;
}

/// Ratios of the modes that small releases show, by falling frequency. Modes slower than `slowest`
/// are left out.
std::vector<double> seen_ratios(const TwinModels& twin, const controller::Settings& settings,
                                const JointVector& q0, double slowest) {
  Random random(1);
  std::vector<testing::Recording> recordings;
  std::optional<ReleasedArm> arm;
  for (Eigen::Index i = 0; i < q0.size(); ++i) {
    const JointVector dq = 1e-6 * random.vector(q0.size());
    arm.emplace(twin, settings, q0, dq);
    recordings.push_back(arm->record(q0, 300));
  }
  const auto fit = testing::fit_states(recordings, settings.period, arm->closed_loop.mass);
  std::vector<double> ratios;
  for (const testing::FittedMode& mode : fit.modes) {
    if (mode.natural_frequency > slowest) ratios.push_back(mode.damping_ratio);
  }
  return ratios;
}

/// Largest and smallest.
struct Range {
  double least = 1e9, most = 0;
  void add(const std::vector<double>& values) {
    for (const double value : values) {
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }
};

TEST(RatioDampingRingDown, KeepsTheRatioOnAWayOnWhichAConstantDampingDrifts) {
  const TwinModels twin(testing::arms()[0], false);
  JointVector start(7);
  start << 0, -0.785, 0, -2.356, 0, 1.571, 0.785;
  const VectorXd way{{0.16, 0.19, 0.13, 0, 0, 0}};  // m
  controller::Gains gains;
  gains.task_stiffness = controller::Vector6(2000, 600, 2000, 100, 100, 100).asDiagonal();
  gains.null_stiffness = gains.null_damping = JointVector::Zero(7);
  analysis::TaskImpedance at_start;
  const auto robot = evaluate(twin.model, start, JointVector::Zero(7));
  at_start.mass = robot.M;
  at_start.jacobian = robot.J;
  at_start.task_stiffness = gains.task_stiffness;
  const auto design = analysis::design_damping(at_start, analysis::DampingTarget::constant(kRatio));
  controller::Gains constant = gains, designed = gains;
  constant.task_damping = design.damping;
  designed.task_damping_ratio = kRatio;
  Range of_designed, of_constant;
  std::printf("  way, m   ratios designed    with the damping of the start\n");
  const auto postures = straight_way(twin, start, way, 6);
  for (std::size_t k = 0; k < postures.size(); ++k) {
    const auto with = [&](const controller::Gains& chosen) {
      const auto settings = release_settings(twin, chosen, 1e-3);
      return seen_ratios(twin, settings, postures[k], 2);
    };
    const std::vector<double> kept = with(designed), drifted = with(constant);
    ASSERT_EQ(kept.size(), 6U);
    for (const double ratio : kept) EXPECT_NEAR(ratio, kRatio, 0.01) << "point " << k;
    Range here_designed, here_constant;
    here_designed.add(kept);
    here_constant.add(drifted);
    std::printf("  %.3f    %.4f to %.4f   %.4f to %.4f\n",
                0.2 * way.norm() * static_cast<double>(k), here_designed.least, here_designed.most,
                here_constant.least, here_constant.most);
    of_designed.add(kept);
    of_constant.add(drifted);
  }
  EXPECT_LT(of_constant.least, 0.6);
  EXPECT_GT(of_constant.most, 0.75);
}

/// The controller knows the friction that the simulated joints have.
class RatioDampingRingDownOf : public ::testing::TestWithParam<testing::Arm> {};
INSTANTIATE_TEST_SUITE_P(Arms, RatioDampingRingDownOf, ::testing::ValuesIn(testing::arms()),
                         [](const auto& instance) { return std::string(instance.param.file); });

TEST_P(RatioDampingRingDownOf, JointsBesideFrictionHasTheRatio) {
  TwinModels twin(GetParam());
  controller::ModelOptions options;
  sim::RobotParameters parameters;
  options.reflected_inertia = parameters.reflected_inertia = JointVector::Constant(twin.dof(), 0.1);
  options.viscous_friction = parameters.viscous_friction = JointVector::Constant(twin.dof(), 1.5);
  twin.model = arm_model(GetParam(), options);
  twin.robot = sim::Robot::from_file(testing::arm_path(GetParam().file), GetParam().base,
                                     GetParam().tip, parameters);
  for (int seed = 1; seed <= 3; ++seed) {
    Random random(static_cast<std::uint64_t>(seed));
    const JointVector q0 = random_posture(twin, random);
    controller::Gains gains;
    gains.null_stiffness = gains.null_damping = JointVector::Zero(twin.dof());
    controller::Settings settings = release_settings(twin, gains, 1e-3);
    settings.subtract_friction = true;
    settings.initial.mode = controller::Mode::kJoint;
    settings.initial.gains.joint_stiffness = 400 * MatrixXd::Identity(twin.dof(), twin.dof());
    settings.initial.gains.joint_damping_ratio = kRatio;
    const std::vector<double> ratios = seen_ratios(twin, settings, q0, 0);
    ASSERT_EQ(static_cast<int>(ratios.size()), twin.dof());
    for (const double ratio : ratios) EXPECT_NEAR(ratio, kRatio, 0.01) << "seed " << seed;
  }
}

}  // namespace
}  // namespace dashpot
