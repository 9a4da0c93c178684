// Limits of the tip's speed that are lowered while the loop runs.
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gtest/gtest.h>

#include <algorithm>

namespace dashpot::controller {
namespace {

TEST(TipSpeed, IsOnlyEverLowered) {
  testing::SimulatedArm arm(
      testing::panda_model(),
      [] {
        Settings settings = testing::quiet_settings(testing::panda_model());
        settings.initial.mode = Mode::kCartesian;
        return settings;
      }(),
      testing::panda_ready());
  const auto fastest = [&](const TipSpeed& speed, double way) {
    arm.controller.limit_tip_speed(speed);
    arm.setpoint.tip_pose.position.y() += way;
    double found = 0;
    for (int k = 0; k < 1500; ++k) {
      EXPECT_LT(arm.step(), Status::kSetpointStale);
      found = std::max(found, arm.controller.snapshot().reference_twist.head<3>().norm());
    }
    return found;
  };
  const double all = arm.controller.settings().motion.linear_velocity;
  EXPECT_NEAR(fastest({}, 0.3), all, 1e-3 * all);
  EXPECT_NEAR(fastest({.linear = 0.1}, -0.1), 0.1, 1e-4);
  EXPECT_NEAR(fastest({.limit = 0.2}, -0.15), 0.12, 1e-4);
  EXPECT_NEAR(fastest({.linear = 10 * all}, 0.3), all, 1e-3 * all);
  arm.controller.limit_tip_speed({.limit = 0.05});
  for (int k = 0; k < 100; ++k) arm.step();
  arm.state.velocity[0] = 0.5;  // a blow: the tip is faster than allowed
  arm.step();
  EXPECT_EQ(arm.controller.snapshot().fault, Status::kTipSpeedLimit);
}

/// The reference of the joint mode is as slow as the tip's, on the way and while it changes.
TEST(TipSpeed, SlowsTheJointModeToo) {
  DASHPOT_SKIP_IF_QUICK();
  Settings settings = testing::quiet_settings(testing::panda_model());
  settings.initial.mode = Mode::kJoint;
  testing::SimulatedArm arm(testing::panda_model(), settings, testing::panda_ready());
  const auto fastest = [&](const TipSpeed& speed, double way, int ticks, bool angular = false) {
    arm.controller.limit_tip_speed(speed);
    arm.setpoint.joint_position[0] += way;
    arm.setpoint.joint_position[3] += 0.5 * way;
    double found = 0;
    for (int k = 0; k < ticks; ++k) {
      EXPECT_LT(arm.step(), Status::kSetpointStale);
      const JointVector& q = arm.controller.snapshot().reference_position;
      const JointVector& qd = arm.controller.snapshot().reference_velocity;
      const Vector6 V = evaluate(arm.model, q, qd).J * qd;
      found = std::max(found, angular ? V.tail<3>().norm() : V.head<3>().norm());
    }
    EXPECT_EQ(arm.controller.snapshot().reference_position, arm.setpoint.joint_position);
    return found;
  };
  EXPECT_GT(fastest({}, 0.8, 3000), 0.2);
  EXPECT_NEAR(fastest({.linear = 0.1}, -0.8, 9000), 0.1, 0.002);
  EXPECT_NEAR(fastest({.limit = 0.1}, 0.4, 9000), 0.06, 0.002);
  EXPECT_NEAR(fastest({.angular = 0.1}, -0.4, 9000, true), 0.1, 0.002);
  EXPECT_GT(fastest({}, -0.8, 3000), 0.2);
  // A limit that comes on the way is reached as the acceleration allows.
  arm.setpoint.joint_position[0] += 0.8;
  for (int k = 0; k < 700; ++k) arm.step();
  arm.controller.limit_tip_speed({.linear = 0.05});
  const JointVector most = 1e-3 * settings.motion.acceleration;
  JointVector last = arm.controller.snapshot().reference_velocity;
  EXPECT_GT(last[0], 0.3);
  for (int k = 0; k < 1000; ++k) {
    arm.step();
    const JointVector& now = arm.controller.snapshot().reference_velocity;
    EXPECT_LE((now - last).cwiseAbs().cwiseQuotient(most).maxCoeff(), 1 + 1e-9);
    last = now;
  }
  const JointVector& q = arm.controller.snapshot().reference_position;
  const Vector6 V = evaluate(arm.model, q, last).J * last;
  EXPECT_NEAR(V.head<3>().norm(), 0.05, 0.001);
}

}  // namespace
}  // namespace dashpot::controller
