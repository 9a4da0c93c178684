// Gains judged on one joint, whose sampled loop is solved by hand.
#include <dashpot/controller/gain_judge.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/constant_damping.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

constexpr double kInertia = testing::kLinkInertia;

/// A damper c held for T makes v <- (1 - c T / I) v, and with the torque a tick late
/// v_k+1 = v_k - c T / I v_k-1: stable up to c T / I = 2, and 1.
class Judge : public ::testing::Test {
 protected:
  Judge() : settings(testing::constant_damping(testing::one_link())) {
    settings.limits.gain_margin = 3;
    gains = settings.initial.gains;
    gains.joint_stiffness.setZero();
    gains.joint_damping.setZero();
    gains.task_stiffness.setZero();
    gains.task_damping.setZero();
    gains.null_stiffness.setZero();
    gains.null_damping.setZero();
  }
  GainJudge::Verdict judge(const RobotModel& model = testing::one_link()) const {
    return GainJudge(model, settings).judge(q, gains);
  }
  double borne() const { return 2 * kInertia / settings.period; }

  const JointVector q = JointVector::Constant(1, 0.4);
  Settings settings;
  Gains gains;
};

TEST_F(Judge, FindsTheMarginOfADamper) {
  for (const double margin : {0.5, 1.5, 2.5}) {
    gains.joint_damping(0, 0) = borne() / margin;
    EXPECT_NEAR(judge().margin, margin, 1e-3 * margin);
    EXPECT_EQ(judge().mode, Mode::kJoint);
    settings.analysis.sampled.delay = 1;
    EXPECT_NEAR(judge().margin, margin / 2, 1e-3 * margin);
    settings.analysis.sampled.delay = 0;
  }
  gains.joint_damping(0, 0) = borne() / 4;
  EXPECT_EQ(judge().margin, 3);  // enough
  gains.joint_damping(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(judge().margin, 0);  // no gain
}

/// The tip is on the joint's axis and turns with it.
TEST_F(Judge, NamesTheModeThatBearsLess) {
  gains.joint_damping(0, 0) = borne() / 2.5;
  gains.task_damping(5, 5) = borne() / 1.5;
  EXPECT_NEAR(judge().margin, 1.5, 1e-3);
  EXPECT_EQ(judge().mode, Mode::kCartesian);
  gains.joint_damping(0, 0) = borne() / 1.2;
  EXPECT_NEAR(judge().margin, 1.2, 1e-3);
  EXPECT_EQ(judge().mode, Mode::kJoint);
}

/// I s^3 + c s^2 + k s + k / time is stable for time > I / c, and so is the sampled loop nearly.
TEST_F(Judge, CountsTheIntegral) {
  gains.joint_damping(0, 0) = 2 * kInertia;  // I / c = 0.5 s
  gains.joint_stiffness(0, 0) = 100 * kInertia;
  for (const double time : {0.45, 0.55}) {
    settings.integral.time = time;
    EXPECT_EQ(judge().margin < 1, time < 0.5) << time;
  }
}

/// Friction that is compensated at the measured velocity takes damping away.
TEST_F(Judge, CountsTheCompensationOfFriction) {
  ModelOptions options;
  options.coulomb_friction = JointVector::Constant(1, 0.5);
  const RobotModel rough = testing::one_link(options);
  settings.feed_forward.friction = true;
  settings.feed_forward.friction_at = FeedForward::FrictionAt::kMeasured;
  gains.joint_stiffness(0, 0) = 100 * kInertia;
  for (const double damping : {3.8, 4.2}) {  // 0.8 * 0.5 / 0.1 = 4
    gains.joint_damping(0, 0) = gains.task_damping(5, 5) = damping;
    EXPECT_EQ(judge(rough).margin < 1, damping < 4) << damping;
  }
}

/// Walls, position limits and external damping do not matter for gains.
TEST_F(Judge, KnowsNoLimits) {
  gains.joint_damping(0, 0) = borne() / 2.5;
  settings.limits.walls = {{{0, 0, 1}, Eigen::Vector3d::UnitZ()}};  // the tip is beyond it
  settings.limits.position_lower[0] = -0.1;
  settings.limits.position_upper[0] = 0.1;  // and the joint, too
  EXPECT_NEAR(judge().margin, 2.5, 2.5e-3);
}

/// The gravity compensation of a joint that falls away from its top grows by about w^2 (1/2 + 1) T
/// with a torque that is a tick late, w^2 = m g l / I; growth below 1/s does not count.
TEST_F(Judge, CountsTheGravityCompensationWhereItGrowsFast) {
  settings.analysis.sampled.delay = 1;
  gains.joint_damping(0, 0) = 1e-3;
  for (const double growth : {0.7, 1.4}) {
    const double gravity = growth / (1.5 * settings.period) * kInertia / 0.25 / std::cos(0.4);
    settings.feed_forward.gravity = true;
    EXPECT_EQ(judge(testing::one_link({}, -gravity)).margin, growth < 1 ? 3 : 0) << growth;
    settings.feed_forward.gravity = false;
    EXPECT_EQ(judge(testing::one_link({}, -gravity)).margin, 3) << growth;
  }
}

/// A damper designed for the inertia of the link and 20 kg, held for T, takes from the link alone
/// (2 - c T / I) of its swing: the margin is 2 I / (T c), whatever the spring.
TEST_F(Judge, JudgesDesignedDampingWithoutThePayload) {
  ModelOptions options;
  options.payload = {20, {0, 0.5, 0}, Eigen::Matrix3d::Zero()};
  const RobotModel loaded = testing::one_link(options);
  const double inertia = evaluate(loaded, q, JointVector::Zero(1)).M(0, 0);
  ASSERT_GT(inertia, 20 * kInertia);
  for (const double margin : {0.5, 0.9, 1.1, 1.3}) {
    const double damper = 2 * kInertia / (settings.period * margin);
    gains.joint_damping_ratio = 0.7;
    gains.joint_stiffness(0, 0) = std::pow(damper / 1.4, 2) / inertia;
    GainJudge one(loaded, settings);
    const GainJudge::Verdict found = one.judge(q, gains);
    const bool enough = margin > GainJudge::kDropped;
    EXPECT_NEAR(found.margin, enough ? 3 : margin, 1e-3 * margin);
    EXPECT_EQ(found.dropped, !enough);
    // The same damper without a ratio is judged with the payload only; so is an arm without
    // payload.
    gains.joint_damping_ratio = 0;
    gains.joint_damping(0, 0) = damper;
    EXPECT_EQ(one.judge(q, gains).margin, 3);
    gains.joint_damping_ratio = 0.7;
    one.attach(Attachment());
    EXPECT_EQ(one.judge(q, gains).margin, 3);
    one.attach(loaded.attachment());
    EXPECT_EQ(one.judge(q, gains).dropped, !enough);
  }
}

}  // namespace
}  // namespace dashpot::controller
