// The integral of the springs: when it grows, stands still, fades, and is let go.
#include <dashpot/controller/attachment.hpp>
#include <dashpot/controller/law/spring_integral.hpp>
#include <dashpot/tests/support/led_arm.hpp>

#include <gtest/gtest.h>

#include <string>

namespace dashpot::controller {
namespace {

using testing::LedArm;

TEST(SpringIntegral, IsASumWithinItsBounds) {
  SpringIntegral integral({0.5, 10, 1, JointVector::Constant(2, 3)}, 0.01);  // a fiftieth a tick
  const JointVector pull{{50, -10}};
  Vector6 wrench;
  wrench << 30, 40, 0, 0, 0, -5;
  integral.step(pull, wrench, true);
  EXPECT_TRUE(integral.torque().isApprox(JointVector{{1, -0.2}}, 1e-15));
  EXPECT_TRUE(integral.wrench().isApprox(wrench / 50, 1e-15));
  for (int k = 0; k < 100; ++k) integral.step(pull, wrench, true);
  EXPECT_TRUE(integral.torque().isApprox(JointVector{{3, -3}}, 1e-15));
  EXPECT_TRUE(integral.wrench().isApprox((Vector6() << 6, 8, 0, 0, 0, -1).finished(), 1e-12));

  EXPECT_EQ(integral.torque()[0], 3);
  integral.step(-pull, -wrench, false);
  EXPECT_NEAR(integral.torque()[0], 2, 1e-15);
  integral.step(pull, wrench, false);
  EXPECT_NEAR(integral.torque()[0], 2, 1e-15);
  EXPECT_NEAR(integral.wrench().head<3>().norm(), 9, 1e-12);
  for (int left = 3; left > 0; --left) integral.fade(left);
  EXPECT_TRUE(integral.torque().isZero(0) && integral.wrench().isZero(0));
  integral.step(JointVector{{1e308, 1}}, Vector6::Constant(1e308), true);
  integral.step(JointVector{{1e308, 1}}, Vector6::Constant(-1e308), true);
  EXPECT_TRUE(integral.torque().allFinite() && integral.wrench().allFinite());
}

/// A Panda that a hand holds away from its goal.
struct PulledArm : LedArm {
  explicit PulledArm(Mode mode) : PulledArm(settings_for(mode)) {}
  explicit PulledArm(const Settings& settings) : LedArm(testing::smooth_panda(), settings) {
    settle();
    state.position[0] += 0.02;
  }
  static Settings settings_for(Mode mode) {
    Settings settings = testing::plain_settings(testing::smooth_panda(), mode);
    settings.watchdog.setpoint_hold = 0.1;
    settings.limits.power = 1e9;
    settings.integral.time = 0.5;
    return settings;
  }
  double stored() const {
    const Snapshot& now = controller.snapshot();
    return now.integral_torque.norm() + now.integral_wrench.norm();
  }
  void stale_tick(std::int64_t after) {  // ns; with the set-point of before
    state.time += after;
    controller.update(state, setpoint, torque);
  }
  void hold(int ticks) {
    for (int k = 0; k < ticks; ++k) tick();
  }
};

class StoredTorque : public ::testing::TestWithParam<const char*> {
 protected:
  const Mode mode = GetParam() == std::string("joint") ? Mode::kJoint : Mode::kCartesian;
};
INSTANTIATE_TEST_SUITE_P(Modes, StoredTorque, ::testing::Values("joint", "cartesian"));

TEST_P(StoredTorque, IsOfTheModeInForceAndActs) {
  Settings settings = PulledArm::settings_for(mode);
  PulledArm arm(settings);
  settings.integral.time = 0;
  PulledArm without(settings);
  for (PulledArm* one : {&arm, &without}) one->hold(400);
  const Vector6 wrench = arm.controller.snapshot().integral_wrench;
  const JointVector torque = arm.controller.snapshot().integral_torque;
  EXPECT_EQ(torque.isZero(0), mode == Mode::kCartesian);
  EXPECT_EQ(wrench.isZero(0), mode == Mode::kJoint);
  EXPECT_EQ(without.stored(), 0);
  for (PulledArm* one : {&arm, &without}) one->tick();
  const auto robot = evaluate(arm.model, arm.state.position, arm.state.velocity);
  const JointVector added = torque + robot.J.transpose() * wrench;
  EXPECT_LT((arm.torque - without.torque - added).norm(), 1e-9 * added.norm());
}

TEST_P(StoredTorque, FadesWhileGainsOrPayloadChange) {
  for (const bool payload : {false, true}) {
    SCOPED_TRACE(payload);
    PulledArm arm(mode);
    arm.hold(400);
    double last = arm.stored();
    ASSERT_GT(last, 0.3);
    if (payload) {
      arm.controller.attach(
          Attachment({1, {0, 0, 0.1}, Eigen::Matrix3d::Zero()}, arm.model.attachment().tool));
    } else {
      arm.setpoint.gains.task_stiffness *= 0.9;
      arm.setpoint.gains.joint_stiffness *= 0.9;
    }
    for (int k = 0; k < 500; ++k) {  // gain_time
      arm.tick();
      ASSERT_TRUE(arm.stored() < last || arm.stored() == 0);
      last = arm.stored();
    }
    EXPECT_EQ(last, 0);
    arm.hold(10);
    EXPECT_GT(arm.stored(), 0);
  }
}

TEST_P(StoredTorque, IsLetGoWithTheSprings) {
  PulledArm arm(mode);
  arm.hold(400);
  EXPECT_GT(arm.stored(), 0.3);
  for (int k = 0; k < 300; ++k) arm.stale_tick(1'000'000);  // the set-point grows old: hold
  const double held = arm.stored();
  arm.stale_tick(1'000'000);
  EXPECT_EQ(arm.stored(), held);
  arm.stale_tick(1'000'000'000);  // a gap: a fault
  EXPECT_NE(arm.controller.snapshot().fault, Status::kOk);
  EXPECT_EQ(arm.stored(), 0);
}

TEST_P(StoredTorque, DoesNotGrowAtALimit) {
  Settings settings = PulledArm::settings_for(mode);
  settings.limits.torque.setConstant(0.02);
  PulledArm weak(settings);
  weak.hold(100);
  EXPECT_EQ(weak.controller.snapshot().status, Status::kTorqueLimited);
  EXPECT_LT(weak.stored(), 1e-12);
  if (mode == Mode::kJoint) return;
  settings = PulledArm::settings_for(mode);
  settings.limits.linear_error = 0.005;  // the springs reach no further, and the reference waits
  PulledArm far(settings);
  far.hold(1000);
  EXPECT_GT(far.controller.snapshot().tip_error.head<3>().norm(), 0.004);
  EXPECT_LT(far.stored(), 0.1) << far.controller.snapshot().tip_error.transpose();
}

}  // namespace
}  // namespace dashpot::controller
