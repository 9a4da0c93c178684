// The promised time and distance of a stop, beside closed forms for one joint.
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/tests/support/arms.hpp>

#include <gmock/gmock.h>

#include <cmath>

namespace dashpot::controller {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr double kInertia = 2;      // kg m^2
constexpr double kBegin = 0.9 * 2;  // rad/s

/// A joint about a vertical axis, which carries no weight.
RobotModel turntable() {
  return RobotModel::from_urdf_text(
      R"(<robot name="turntable"><link name="base"/><joint name="turn" type="continuous">
      <parent link="base"/><child link="table"/><axis xyz="0 0 1"/>
      <limit velocity="2" effort="1000"/></joint><link name="table"><inertial><mass value="1"/>
      <inertia ixx="2" ixy="0" ixz="0" iyy="2" iyz="0" izz="2"/></inertial></link></robot>)",
      "base", "table", {});
}

TEST(Stopping, TakesTheTimeAndWayOfTheClosedForm) {
  const RobotModel model = turntable();
  const JointVector q = JointVector::Zero(1);
  Settings settings = default_settings(model);
  const double T = settings.limits.stopping_time;
  const auto stop = [&](double torque, double rate) {
    settings.limits.torque.setConstant(torque);
    settings.limits.torque_rate.setConstant(rate);
    return stopping(model, settings, q);
  };
  // v decays with T.
  const Stopping firm = stop(1e4, 1e8);
  EXPECT_NEAR(firm.time[0], T * std::log(10), 0.003);
  EXPECT_NEAR(firm.way[0], 0.9 * kBegin * T, 0.003);
  // The whole torque until the brake M / T needs less.
  const double torque = 20, slow = torque * T / kInertia;
  const Stopping weak = stop(torque, 1e8);
  EXPECT_NEAR(weak.time[0],
              (kBegin - slow) * kInertia / torque + T * std::log(slow / (0.1 * kBegin)), 0.003);
  EXPECT_NEAR(weak.way[0],
              (kBegin * kBegin - slow * slow) * kInertia / (2 * torque) + T * (slow - 0.1 * kBegin),
              0.004);
  // The torque rises at its rate until half of the speed remains, and falls at it.
  const double rate = 50;
  EXPECT_NEAR(
      stop(1e4, rate).time[0],
      std::sqrt(kInertia * kBegin / rate) * (1 + std::sqrt(2) * (std::sqrt(0.5) - std::sqrt(0.1))),
      0.015);
}

TEST(Stopping, ASlowTorqueRateIsNamedWithOneThatWouldDo) {
  const RobotModel model = turntable();
  const JointVector q = JointVector::Zero(1);
  Settings settings = default_settings(model);
  settings.limits.torque_rate.setConstant(50);
  const std::string said = slow_stop(model, settings, q);
  EXPECT_THAT(said, StartsWith("limits.torque_rate: 50 lets the brake stop joint 'turn' in 0.4"));
  EXPECT_THAT(said, HasSubstr("; 200 would do it in 0.2"));
  settings.limits.torque_rate.setConstant(200);
  EXPECT_EQ(slow_stop(model, settings, q), "");
  settings.limits.torque.setConstant(8);  // no rate helps
  EXPECT_GT(stopping(model, settings, q).time[0], 0.4);
  EXPECT_EQ(slow_stop(model, settings, q), "");
}

TEST(Stopping, DefaultsAreFastEnough) {
  for (const testing::Arm& arm : testing::all_arms()) {
    const RobotModel model = arm_model(arm);
    EXPECT_EQ(slow_stop(model, default_settings(model), default_posture(model)), "") << arm.file;
  }
}

}  // namespace
}  // namespace dashpot::controller
