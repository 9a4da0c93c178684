// An arm that drops the payload for which its damping was designed.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/tests/support/released_arm.hpp>

#include <gtest/gtest.h>

#include <cstdio>

namespace dashpot {
namespace {

using controller::Attachment;
using controller::JointVector;

/// An iiwa 7 whose drives are a tick late drops at 0.3 s the 3 kg at 0.12 m for which its damping
/// is designed. Springs and dampers settle if the wrist alone has a margin of 1.31; at 0.93 they
/// shake it.
TEST(PayloadInTheLoop, ShakesAWristThatDropsItWhereTheJudgeSaysSo) {
  const testing::Arm file = testing::all_arms()[4];
  const controller::Payload payload{3, {0, 0, 0.12}, 0.003 * Eigen::Matrix3d::Identity()};
  const controller::RobotModel told = arm_model(file).with(Attachment(payload, {}));
  JointVector q0(7);
  q0 << 0, 0.6, 0, -1.2, 0, 0.9, 0;
  controller::Settings settings = controller::default_settings(told);
  settings.initial.mode = controller::Mode::kCartesian;
  settings.initial.gains.task_stiffness.diagonal() << 1500, 1500, 1500, 20, 20, 20;
  settings.analysis.where = controller::Analysis::Where::kOff;
  settings.analysis.sampled.delay = 1;
  settings.motion.gain_time = 0.05;
  for (const double ratio : {0.7, 1.0}) {
    settings.initial.gains.task_damping_ratio = ratio;
    const auto verdict = controller::GainJudge(told, settings).judge(q0, settings.initial.gains);
    const bool stable = ratio < 1;
    EXPECT_EQ(verdict.dropped, !stable);
    EXPECT_NEAR(verdict.margin, stable ? settings.limits.gain_margin : 0.926, 0.001);

    sim::ArmOptions options;
    options.loads.push_back({0, 0.3, {payload.mass, payload.center, payload.inertia}});
    sim::Arm arm(sim::Robot::from_file(testing::arm_path(file.file), file.base, file.tip), options);
    controller::Controller controller(told, settings);
    controller::Setpoint setpoint = settings.initial;
    setpoint.joint_position = q0;
    const auto there = evaluate(told, q0, JointVector::Zero(7));
    setpoint.tip_pose = {there.p_BT_B, there.R_BT};
    controller.reset(there.gravity);
    sim::PlantOptions plant_options;
    plant_options.delay = 1;
    plant_options.initial_torque = there.gravity;
    sim::Plant plant(arm, plant_options, q0);
    controller::RobotState state;
    JointVector torque;
    for (int tick = 0; tick < 1000; ++tick) {
      state.time = setpoint.time = 1'000'000 * tick;
      state.position = plant.measured().position;
      state.velocity = plant.measured().velocity;
      controller.update(state, setpoint, torque);
      EXPECT_EQ(plant.step(torque), sim::Status::kOk);
      EXPECT_TRUE(tick > 300 || controller.snapshot().fault == controller::Status::kOk) << tick;
    }
    const controller::Status fault = controller.snapshot().fault;
    std::printf("3 kg dropped, ratio %.1f: margin %.3f; %s\n", ratio, verdict.margin,
                to_text(fault));
    EXPECT_EQ(fault, stable ? controller::Status::kOk : controller::Status::kInstability);
    EXPECT_TRUE(!stable || plant.velocity().cwiseAbs().maxCoeff() < 0.01);
  }
}

}  // namespace
}  // namespace dashpot
