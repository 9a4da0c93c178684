// Payload and tool that change while the loop runs.
#include <dashpot/controller/attachment.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/dynamics_match.hpp>
#include <dashpot/tests/support/led_arm.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>

#include <gmock/gmock.h>

#include <Eigen/Geometry>

namespace dashpot::controller {
namespace {

using testing::Random;

Payload some_payload(double mass = 2) {
  Payload payload{mass, {0.03, -0.02, 0.07}, Eigen::Matrix3d::Zero()};
  payload.inertia.diagonal() << 0.004, 0.005, 0.003;
  return payload;
}

Pose some_tool() {
  return {{0.05, -0.03, 0.12},
          Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix()};
}

/// A Panda that does not move, whatever its torque.
struct HeldArm : testing::LedArm {
  explicit HeldArm(const Attachment& configured = {})
      : LedArm(testing::panda_model().with(configured), held_settings()) {
    place(testing::panda_ready());
    setpoint.joint_position = state.position;
    setpoint.tip_pose = tip();
    controller.reset(weight(model));
  }
  static Settings held_settings() {
    Settings settings = default_settings(testing::panda_model());
    settings.initial.mode = Mode::kCartesian;
    settings.initial.gains.task_damping_ratio = 0.7;
    settings.watchdog.feedback = 0;
    settings.watchdog.setpoint_hold = settings.watchdog.setpoint_damp = 0;
    return settings;
  }
  JointVector weight(const RobotModel& of) const {
    return evaluate(of, state.position, JointVector::Zero(7)).gravity;
  }
  Pose tip() const {
    const auto there = evaluate(model, state.position, state.velocity);
    return {there.p_BT_B, there.R_BT};
  }
  Status tick() {  // without a new set-point
    state.time += 1'000'000;
    return controller.update(state, setpoint, torque);
  }
  Status ticks(int count) {
    Status worst = Status::kOk;
    for (int i = 0; i < count; ++i) worst = worse(worst, tick());
    return worst;
  }
};

TEST(Attachment, OfNoBodyIsRefused) {
  const auto expect_refusal = [](const Payload& payload, const Pose& tool, const char* reason) {
    EXPECT_THAT(
        [&] {
          (Attachment{payload, tool});
        },
        ::testing::ThrowsMessage<InvalidModel>(::testing::HasSubstr(reason)));
  };
  EXPECT_NO_THROW((Attachment{some_payload(), Pose()}));
  expect_refusal(some_payload(-1), {}, "payload: its mass is negative, -1 kg");
  expect_refusal(some_payload(std::nan("")), {}, "payload: its mass is not a finite number");
  Payload far = some_payload(1e300);
  far.center.setConstant(1e10);
  expect_refusal(far, {}, "payload: too large");
  Payload thin = some_payload();
  thin.inertia(2, 2) = 0.1;
  expect_refusal(thin, {}, "triangle inequality");
  Pose wrong;
  wrong.rotation(0, 0) = -1;
  expect_refusal(some_payload(), wrong, "tool: not a rotation and a finite position");
}

TEST(Attachment, MakesTheKernelThatOfTheConfiguredModel) {
  Random random(1);
  for (const testing::Arm& arm : testing::arms()) {
    ModelOptions options;
    options.payload = some_payload();
    options.tool = some_tool();
    const RobotModel bare = testing::arm_model(arm), loaded = testing::arm_model(arm, options);
    DynamicsKernel changed(bare);
    changed.attach(Attachment(options.payload, options.tool));
    for (int k = 0; k < 5; ++k) {
      const JointVector q = random.vector(bare.dof()), qd = random.vector(bare.dof());
      const DynamicsResult wanted = evaluate(loaded, q, qd);
      DynamicsResult found;
      changed.evaluate(q, qd, found);
      EXPECT_TRUE(testing::same_dynamics(found, wanted, qd, 0));
      // The weight of the body is at its centre.
      const DynamicsResult before = evaluate(bare, q, qd);
      const Eigen::Vector3d r = before.R_BT * options.payload.center;
      Vector6 weight;
      weight << -2 * bare.gravity(), -2 * r.cross(bare.gravity());
      EXPECT_LT((found.gravity - before.gravity - before.J.transpose() * weight).norm(), 1e-12);
    }
  }
}

TEST(Attachment, InTheLoopGivesTheModesOfTheConfiguredOne) {
  const Attachment attachment(some_payload(), some_tool());
  HeldArm told, configured(attachment);
  ASSERT_EQ(told.ticks(600), Status::kOk);
  const Vibration before = told.controller.vibration();
  told.controller.attach(attachment);
  told.model = told.model.with(attachment);
  ASSERT_EQ(told.ticks(600), Status::kOk);
  ASSERT_EQ(configured.ticks(1200), Status::kOk);
  EXPECT_LT((told.torque - configured.torque).norm(), 1e-9);
  const Vibration &found = told.controller.vibration(), &wanted = configured.controller.vibration();
  ASSERT_EQ(found.count, wanted.count);
  ASSERT_GE(found.count, 6);
  for (std::size_t i = 0; i < static_cast<std::size_t>(found.count); ++i) {
    const double omega = wanted.modes[i].natural_frequency;
    EXPECT_NEAR(found.modes[i].natural_frequency, omega, 1e-11 * omega);
    EXPECT_NEAR(found.modes[i].damping_ratio, wanted.modes[i].damping_ratio, 1e-10);
    const double change = std::abs(before.modes[i].natural_frequency - omega);
    EXPECT_GT(change, i < 3 ? 0.01 * omega : -1);
  }
  EXPECT_NEAR(told.controller.snapshot().payload.mass, 2, 1e-15);
  EXPECT_LT((told.controller.snapshot().payload.center - some_payload().center).norm(), 1e-15);
}

TEST(Attachment, ChangesTheTorqueEvenly) {
  HeldArm arm;
  ASSERT_EQ(arm.ticks(600), Status::kOk);
  const JointVector start = arm.torque;
  const Attachment attachment(some_payload(), {});
  const JointVector added = arm.weight(arm.model.with(attachment)) - arm.weight(arm.model);
  arm.controller.attach(attachment);
  for (int k = 1; k <= 500; ++k) {
    Status status = Status::kOk;
    ASSERT_EQ(testing::allocations_of([&] { status = arm.tick(); }), 0);
    ASSERT_EQ(status, Status::kOk);
    ASSERT_LT((arm.torque - start - k / 500.0 * added).norm(), 1e-9) << k;
    ASSERT_NEAR(arm.controller.snapshot().payload.mass, k / 250.0, 1e-12);
  }
  arm.ticks(10);
  EXPECT_LT((arm.torque - start - added).norm(), 1e-9);
}

TEST(Attachment, MovesNoSpringWithTheTool) {
  HeldArm arm;
  ASSERT_EQ(arm.ticks(600), Status::kOk);
  // Springs that are extended, because something pushed the arm.
  arm.setpoint.tip_pose = arm.controller.snapshot().tip;
  for (int i = 0; i < 200; ++i) {
    arm.state.position[1] += 1e-4;
    arm.state.velocity[1] = 0.1;
    arm.tick();
  }
  arm.state.velocity.setZero();
  arm.ticks(100);
  ASSERT_EQ(arm.ticks(300), Status::kOk);
  const Snapshot before = arm.controller.snapshot();
  ASSERT_GT(before.tip_error.head<3>().norm(), 0.005);
  arm.controller.attach(Attachment({}, some_tool()));
  Snapshot last = before;
  for (int k = 0; k < 600; ++k) {
    arm.tick();
    const Snapshot& now = arm.controller.snapshot();
    const Pose on_link = carried(now.reference_tip, now.tool, {});
    ASSERT_LT((on_link.position - before.reference_tip.position).norm(), 1e-9) << k;
    ASSERT_LT((on_link.rotation - before.reference_tip.rotation).norm(), 1e-9) << k;
    ASSERT_LT((now.tip_error.tail<3>() - before.tip_error.tail<3>()).norm(), 1e-9) << k;
    ASSERT_LT((now.torque - last.torque).cwiseAbs().maxCoeff(), 0.05) << k;
    last = now;
  }
  // From now on a pose refers to the new T: here it is the pose of T, so that the springs relax.
  arm.model = arm.model.with(Attachment({}, some_tool()));
  arm.setpoint.tip_pose = arm.tip();
  arm.setpoint.time = arm.state.time;
  arm.ticks(1500);
  EXPECT_LT(arm.controller.snapshot().tip_error.norm(), 1e-9);
}

TEST(Attachment, FollowsInAFaultAndStaysInAReset) {
  HeldArm arm;
  ASSERT_EQ(arm.ticks(600), Status::kOk);
  arm.state.time += 1'000'000'000;
  ASSERT_EQ(arm.tick(), Status::kTimeGap);
  const Attachment attachment(some_payload(), {});
  const JointVector weight = arm.weight(arm.model.with(attachment));
  arm.controller.attach(attachment);
  EXPECT_EQ(arm.ticks(600), Status::kFaultLatched);
  EXPECT_LT((arm.torque - weight).norm(), 1e-9);
  arm.controller.release();
  EXPECT_LE(arm.ticks(600), Status::kTorqueLimited);
  EXPECT_LT((arm.torque - weight).norm(), 1e-6);
  arm.controller.attach(Attachment());
  arm.ticks(100);
  arm.controller.reset();
  arm.tick();
  EXPECT_EQ(arm.controller.snapshot().payload.mass, 0);
}

}  // namespace
}  // namespace dashpot::controller
