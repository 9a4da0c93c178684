// The closed loop in factored form against the plain one of closed_loop.hpp, for all kinds of
// gains.
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/controller.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/vibration/closed_loop.hpp>
#include <dashpot/controller/vibration/loop_system.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/random_robot.hpp>

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using testing::near;
using testing::Random;

/// One robot in one posture, and its loop with whatever springs.
struct Loop {
  RobotModel model;
  int n;
  JointVector q, friction;
  DynamicsResult robot;
  LoopSystem factored;
  bool nearly_singular = false;  // when last asked

  Loop(const RobotModel& robot_model, Random& random)
      : model(robot_model), n(model.dof()), friction(random.vector(n).cwiseAbs()) {
    move_to(random.vector(n));
  }
  void move_to(const JointVector& there) {
    q = there;
    DynamicsKernel(model).evaluate(q, JointVector::Zero(n), robot);
  }
  /// Expects the same M, C and K of both forms; returns the number of rows of the factor.
  Eigen::Index expect_agreement(const Impedance& impedance) {
    NullSpace null_space;
    null_space.compute(robot, impedance);
    nearly_singular = null_space.inertia().nearly_singular();
    analysis::System<kMaxJoints> plain, system;
    for (analysis::System<kMaxJoints>* one : {&plain, &system}) {  // of the earlier contents
      one->has_low_words = true;
      one->stiffness_factor.setOnes(3, 2);
    }
    closed_loop(robot, JointVector::Zero(n), {impedance, null_space, friction, {}}, {}, plain);
    factored.form(robot, impedance, null_space, friction, system);
    EXPECT_FALSE(plain.has_low_words || system.has_low_words);
    EXPECT_EQ(system.stiffness_factor.cols(), n);
    EXPECT_TRUE(near(system.mass, plain.mass, 0));
    EXPECT_EQ(system.damping, system.damping.transpose());
    EXPECT_TRUE(near(system.damping, plain.damping, 1e-9 * (1 + plain.damping.norm())));
    const MatrixXd W = system.stiffness_factor;
    EXPECT_TRUE(near(W.transpose() * W, plain.stiffness, 1e-9 * (1 + plain.stiffness.norm())));
    return W.rows();
  }
};

/// Springs of the tip in some directions of a frame, and in the null space.
Setpoint tip_setpoint(Random& random, int n, Frame frame, int held) {
  Setpoint setpoint;
  setpoint.mode = Mode::kCartesian;
  Gains& gains = setpoint.gains;
  gains.frame = frame;
  gains.directions.fill(false);
  for (int left = held; left > 0;) {
    bool& direction = gains.directions[static_cast<std::size_t>(random.integer(0, 5))];
    left -= direction ? 0 : 1;
    direction = true;
  }
  gains.task_stiffness = 100 * random.spd(6);
  gains.task_damping = 10 * random.spd(6);
  gains.null_stiffness = 20 * random.vector(n).cwiseAbs();
  gains.null_damping = 2 * random.vector(n).cwiseAbs();
  gains.null_damping_ratio = held % 2 == 0 ? 0.6 : 0;
  return setpoint;
}

/// Returns the number of twelve cases whose null space has rows of its own.
int expect_tip_springs(Random& random, int n) {
  int regular = 0;
  Loop loop(RobotModel::from_urdf_text(testing::RandomRobot(random.engine()()).chain(n, 0.2),
                                       "link0", "tip", {}),
            random);
  for (const Frame frame : {Frame::kBase, Frame::kTool}) {
    for (int held = 1; held <= 6; ++held) {
      Setpoint setpoint = tip_setpoint(random, n, frame, held);
      Gains& gains = setpoint.gains;
      const Eigen::Index free = std::max(0, n - held);
      EXPECT_EQ(loop.expect_agreement(Impedance(setpoint, n)), held + free);
      for (int k = 0; k < 3; ++k) {  // a little further each time: the free motions are followed
        loop.move_to(loop.q + JointVector(0.02 * random.vector(n)));
        EXPECT_EQ(loop.expect_agreement(Impedance(setpoint, n)), held + free);
      }
      if (loop.nearly_singular) continue;  // has a row for each joint instead
      ++regular;
      // Null-space springs in a single joint are not definite in all of the null space; dampers
      // alone, or an empty null space, give no rows.
      const auto rows = [&] { return loop.expect_agreement(Impedance(setpoint, n)); };
      for (int i = 0; i < n && free > 1; ++i) {
        gains.null_stiffness = 30 * JointVector::Unit(n, i);
        EXPECT_GE(rows(), held);
      }
      gains.null_stiffness.setZero(n);
      EXPECT_EQ(rows(), held);
      gains.null_damping.setZero(n);
      EXPECT_EQ(rows(), held);
      gains.task_stiffness.setZero();
      EXPECT_EQ(rows(), 0);
      gains.null_stiffness.setOnes(n);
      EXPECT_EQ(rows(), free);
    }
  }
  return regular;
}

TEST(LoopSystem, HasTheTipSpringsAndAsManyRowsAsTheyHold) {
  Random random(361);
  int regular = 0;
  for (int k = 0; k < 5; ++k) {
    for (const int n : {6, 7, 9}) regular += expect_tip_springs(random, n);
  }
  EXPECT_GE(regular, 150);  // of 180
}

TEST(LoopSystem, HasARowForEachJointWithAnotherProjector) {
  Random random(362);
  for (const auto& [name, projector] : kNullProjectors) {
    for (const int n : {6, 7, 9}) {
      Loop loop(RobotModel::from_urdf_text(testing::RandomRobot(random.engine()()).chain(n, 0.2),
                                           "link0", "tip", {}),
                random);
      for (int held = 1; held <= 6; ++held) {
        Setpoint setpoint = tip_setpoint(random, n, Frame::kTool, held);
        const Impedance before(setpoint, n);
        setpoint.gains.null_projector = projector;
        const Impedance after(setpoint, n);
        const bool all = projector == NullProjector::kNone;
        const bool any = all || n > held;
        for (const Impedance& impedance : {after, blend(before, after, 0.3)}) {
          EXPECT_EQ(loop.expect_agreement(impedance), any ? n : held)
              << name << ", " << n << ", " << held;
        }
      }
    }
  }
}

TEST(LoopSystem, HasTheSpringsOfEitherModeAndOfTwoModesAndFramesAtOnce) {
  Random random(363);
  Loop loop(testing::arm_model(testing::arms()[1]), random);
  for (int k = 0; k < 21; ++k) {
    loop.move_to(random.vector(7));
    const auto rows = [&](const Impedance& impedance) { return loop.expect_agreement(impedance); };
    Setpoint thin, full;
    full.gains.joint_stiffness = 100 * random.spd(7);
    full.gains.joint_damping = thin.gains.joint_damping = 10 * random.spd(7);
    const MatrixXd root = random.matrix(7, k % 7);
    thin.gains.joint_stiffness = root * root.transpose();
    const Impedance joint(full, 7);
    EXPECT_EQ(rows(joint), 7);
    EXPECT_EQ(rows(Impedance(thin, 7)), k % 7);
    const Impedance base(tip_setpoint(random, 7, Frame::kBase, random.integer(1, 6)), 7);
    const Impedance tool(tip_setpoint(random, 7, Frame::kTool, random.integer(1, 6)), 7);
    const double s = random.uniform(0.1, 0.9);
    EXPECT_EQ(rows(blend(joint, base, s)), 7);
    EXPECT_EQ(rows(blend(tool, joint, s)), 7);
    EXPECT_EQ(rows(blend(base, tool, s)), 7);
    EXPECT_EQ(rows(tool), 7);
    // A direction in either frame has springs, with dampers alone in the null space.
    Setpoint one = tip_setpoint(random, 7, Frame::kBase, 1);
    one.gains.null_stiffness.setZero();
    const auto in_base = Impedance(one, 7);
    one.gains.frame = Frame::kTool;
    EXPECT_EQ(rows(blend(in_base, Impedance(one, 7), s)), 2);
    EXPECT_EQ(rows(blend(joint, in_base, s)), 7);
  }
}

TEST(DirectionsHeld, CountsThoseOfOneFrame) {
  TipImpedance base, tool;
  EXPECT_EQ(selected_directions(base, tool), 0);
  for (TipImpedance* one : {&base, &tool}) {
    for (int i = 0; i < 6; ++i) {
      one->selected.setZero();
      one->selected[i] = 1;
      EXPECT_EQ(selected_directions(base, tool), 1);
      one->selected[5 - i] = 0.5;  // while gains change
      EXPECT_EQ(selected_directions(base, tool), -1);
    }
    one->selected.setOnes();
    EXPECT_EQ(selected_directions(base, tool), 6);
    one->selected.setZero();
  }
  base.selected[0] = tool.selected[0] = 1;
  EXPECT_EQ(selected_directions(base, tool), -1);
}

// The closed loop at a posture, against the loop of a controller that runs there.

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
