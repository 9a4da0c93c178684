// The closed loop at a posture, against the loop of a controller that runs there.
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using testing::near;

/// Returns the loop of a controller at rest at q, once its gains are active.
analysis::System<kMaxJoints> by_controller(const RobotModel& model, Settings settings, Mode mode,
                                           const JointVector& q, const Vector6& wrench) {
  settings.motion.gain_time = settings.period;
  Controller controller(model, settings);
  RobotState state;
  state.position = q;
  state.velocity.setZero(q.size());
  state.external_wrench = wrench;
  Setpoint setpoint = settings.initial;
  setpoint.mode = mode;
  setpoint.joint_position = q;
  const DynamicsResult there = evaluate(model, q, state.velocity);
  setpoint.tip_pose = {there.p_BT_B, there.R_BT};
  JointVector torque;
  for (int tick = 1; tick <= 3; ++tick) {
    state.time = setpoint.time = tick * 1'000'000;
    EXPECT_LE(controller.update(state, setpoint, torque), Status::kLittleMargin);
  }
  analysis::System<kMaxJoints> system;
  controller.closed_loop(system);
  return system;
}

/// With constant and designed damping, friction, an environment and a load.
TEST(PostureLoop, IsThatOfAControllerThere) {
  testing::Random random(3901);
  for (int k = 0; k < 48; ++k) {
    SCOPED_TRACE(k);
    const testing::Arm& arm = testing::arms()[static_cast<std::size_t>(k % 3)];
    const int n = testing::arm_model(arm).dof();
    ModelOptions options;
    options.viscous_friction = 0.4 * random.vector(n).cwiseAbs();
    const RobotModel model = testing::arm_model(arm, options);
    Settings settings = default_settings(model);
    Gains& gains = settings.initial.gains;
    gains.null_damping_ratio = k % 4 < 2 ? 0.5 : 0;
    if (k % 5 == 0) gains.task_damping_ratio = gains.joint_damping_ratio = 0;
    settings.limits.gain_margin = k % 6 < 3 ? 1 : 2;
    settings.subtract_friction = k % 7 == 0;
    gains.null_projector =
        kNullProjectors[static_cast<std::size_t>(k) / 3 % kNullProjectors.size()].second;
    settings.null_weights = JointVector::LinSpaced(n, 0.3, 3);
    if (k % 4 == 1) settings.environment.tip_stiffness.setConstant(50);
    if (k % 4 == 2) settings.environment.joint_damping.setConstant(n, 0.3);
    settings.task_terms.load = static_cast<Load>(k % 4);
    const Vector6 wrench = k % 8 < 4 ? Vector6(Vector6::Zero()) : Vector6(5 * random.vector(6));
    JointVector q(n);
    for (Eigen::Index i = 0; i < n; ++i) {  // well within the limits
      const double lower = std::max(settings.limits.position_lower[i], -2.0);
      q[i] = lower +
             random.uniform(0.2, 0.8) * (std::min(settings.limits.position_upper[i], 2.0) - lower);
    }
    PostureLoop loop(model, settings);
    for (const Mode mode : {Mode::kJoint, Mode::kCartesian}) {
      const auto wanted = by_controller(model, settings, mode, q, wrench);
      analysis::System<kMaxJoints> found;
      ASSERT_EQ(loop.closed_loop(q, gains, mode, found, wrench), Status::kOk);
      EXPECT_TRUE(near(found.mass, wanted.mass, 0));
      EXPECT_TRUE(near(found.damping, wanted.damping, 1e-9 * (1 + wanted.damping.norm())));
      EXPECT_TRUE(near(found.stiffness, wanted.stiffness, 1e-9 * (1 + wanted.stiffness.norm())));
      ASSERT_EQ(found.stiffness_factor.rows(), wanted.stiffness_factor.rows());
      if (!wrench.isZero(0)) continue;
      settings.initial.mode = mode;
      const LoopAt audited = Audit(model, audit_options(settings)).at(q);
      EXPECT_TRUE(near(audited.system.damping, found.damping, 0));
      EXPECT_TRUE(near(audited.system.stiffness, found.stiffness, 0));
      EXPECT_EQ(audited.sampled.passive_stiffness, loop.sampled().passive_stiffness);
    }
  }
}

TEST(PostureLoop, RefusesWhatIsNoPosture) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const RobotModel model = testing::arm_model(testing::arms()[0]);
  const Settings settings = default_settings(model);
  PostureLoop loop(model, settings);
  analysis::System<kMaxJoints> system;
  const auto status = [&](const JointVector& q, const Vector6& wrench) {
    return loop.closed_loop(q, settings.initial.gains, Mode::kJoint, system, wrench);
  };
  const JointVector q = JointVector::Zero(7);
  EXPECT_EQ(status(q.head(6), Vector6::Zero()), Status::kStateWrongSize);
  EXPECT_EQ(status(kNan * q, Vector6::Zero()), Status::kStateNotFinite);
  EXPECT_EQ(status(q, Vector6::Constant(kNan)), Status::kWrenchNotFinite);
  EXPECT_EQ(system.mass.size(), 0);
  EXPECT_EQ(status(q, Vector6::Zero()), Status::kOk);
  EXPECT_EQ(system.mass.rows(), 7);
}

}  // namespace
}  // namespace dashpot::controller
