// What gains do in a sampled loop: against one that is stepped tick by tick, and closed forms.
#include <dashpot/tests/controller/audited_panda.hpp>
#include <dashpot/tests/support/chains.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

/// Runs the sampled loop with `factor` times the gains, and returns the largest deflection of the
/// last ticks over that of those before.
double growth(const TaskLoop& loop, const AuditOptions& options, double factor) {
  const Eigen::Index n = loop.M.rows();
  const Eigen::MatrixXd M = loop.M.cast<double>(), K = factor * loop.K.cast<double>(),
                        C = factor * loop.C.cast<double>();
  const Eigen::LLT<Eigen::MatrixXd> mass(M);
  const double T = options.period;
  const double gain = options.cutoff > 0 ? -std::expm1(-2 * M_PI * options.cutoff * T) : 1;
  const Eigen::VectorXd start = Eigen::VectorXd::LinSpaced(n, 1, 2);
  Eigen::VectorXd q = start, velocity = Eigen::VectorXd::Zero(n), before = q;
  Eigen::VectorXd filtered = Eigen::VectorXd::Zero(n), stored = filtered;
  std::vector<Eigen::VectorXd> queue(static_cast<std::size_t>(options.delay),
                                     Eigen::VectorXd::Zero(n));
  double early = 0, late = 0;
  constexpr int kTicks = 40000;
  for (int tick = 0; tick < kTicks; ++tick) {
    const Eigen::VectorXd used =
        options.difference_velocity ? Eigen::VectorXd((q - before) / T) : velocity;
    queue.push_back(-K * q - C * used - stored);
    if (options.integral_time > 0) stored += T / options.integral_time * K * q;
    filtered += gain * (queue.front() - filtered);
    queue.erase(queue.begin());
    const Eigen::VectorXd acceleration = mass.solve(filtered);
    before = q;
    q += T * velocity + 0.5 * T * T * acceleration;
    velocity += T * acceleration;
    const double size = (K * q).norm() + T * (K * velocity).norm();
    if (tick >= kTicks / 2 && tick < 3 * kTicks / 4) early = std::max(early, size);
    if (tick >= 3 * kTicks / 4) late = std::max(late, size);
    if (!(size < 1e200)) return std::numeric_limits<double>::infinity();
  }
  return late / early;
}

TEST(Audit, FindsTheMarginAtWhichASampledLoopStartsToGrow) {
  const RobotModel model = audited_panda();
  AuditOptions options = stated(kTranslationFirst, 2);
  options.period = 0.0005;
  for (const bool slow : {false, true}) {
    options.delay = slow ? 1 : 0;
    options.cutoff = slow ? 300 : 0;
    options.difference_velocity = slow;
    const Audit audit(model, options);
    const double margin = audit.numbers(home()).gain_margin;
    const TaskLoop loop =
        loop_at(model, home(), options.gains.task_stiffness, options.gains.task_damping);
    EXPECT_LT(growth(loop, options, 0.995 * margin), 1) << margin;
    EXPECT_GT(growth(loop, options, 1.005 * margin), 1) << margin;
    EXPECT_NEAR(audit.audit(home()).numbers.gain_margin, margin, 1e-6 * margin);
    EXPECT_TRUE(audit.audit(home()).integral_decays.empty());
  }
}

TEST(Audit, CountsTheIntegralOfTheSprings) {
  const RobotModel model = audited_panda();
  AuditOptions options = stated(kTranslationFirst, 2);
  options.period = 0.0005;
  options.delay = 1;
  options.half_quaternion = true;
  const double without = Audit(model, options).numbers(home()).gain_margin;
  Matrix6 K = options.gains.task_stiffness;  // with which the springs act
  K.bottomRightCorner<3, 3>() *= 0.5;
  const TaskLoop loop = loop_at(model, home(), K, options.gains.task_damping);
  for (const double time : {0.02, 1.0}) {
    SCOPED_TRACE(time);
    options.integral_time = time;
    const Audit audit(model, options);
    const PostureAudit found = audit.audit(home());
    const double margin = found.numbers.gain_margin;
    EXPECT_NEAR(audit.numbers(home()).gain_margin, margin, 1e-5 * margin);
    ASSERT_GE(found.integral_decays.size(), 6U);
    if (time < 0.1) {  // slow modes follow it, and it is unstable
      EXPECT_GT(growth(loop, options, 1), 1);
      EXPECT_LT(margin, 1);
      continue;
    }
    EXPECT_LT(growth(loop, options, 0.995 * margin), 1) << margin;
    EXPECT_GT(growth(loop, options, 1.005 * margin), 1) << margin;
    EXPECT_NEAR(margin, without, 1e-3 * without);  // at which a wrist vibrates, much faster
    for (const double decay : found.integral_decays) EXPECT_NEAR(decay * time, 1, 0.6);
    EXPECT_TRUE(std::is_sorted(found.integral_decays.begin(), found.integral_decays.end()));
  }
}

/// A damper c held for T makes v <- (1 - c T / I) v: stable up to c T / I = 2.
TEST(Audit, FindsPoleAndMarginOfOneJoint) {
  constexpr double kInertia = 0.02 + 0.25 * 0.25;  // of a link of the chain, kg m^2
  ModelOptions model;
  model.viscous_friction = model.coulomb_friction = JointVector::Zero(1);
  AuditOptions options;
  options.mode = Mode::kJoint;
  options.gains.joint_stiffness = JointMatrix::Constant(1, 1, 1e-3);
  options.gains.joint_damping = JointMatrix::Constant(1, 1, 10);
  options.period = 0.001;
  options.soft_frequency = 1e-3;
  const PostureNumbers found =
      Audit(testing::chain_of({"continuous"}, model), options).numbers(JointVector::Zero(1));
  EXPECT_NEAR(found.fastest_pole, -10 / kInertia, 1e-3);
  EXPECT_NEAR(found.gain_margin, 2 * kInertia / (10 * options.period), 1e-3);
  EXPECT_NEAR(found.smallest_ratio, 10 / (2 * std::sqrt(1e-3 * kInertia)), 1e-3);
  EXPECT_EQ(found.zero_modes, 0);
}

/// With an integral l is a root of I l^3 + s (c l^2 + k l + k / t): stable for s > I / (c t).
TEST(Audit, FindsSlowModeAndMarginOfOneJointWithAnIntegral) {
  constexpr double kInertia = 0.02 + 0.25 * 0.25, kSpring = 20, kDamper = 2, kPeriod = 1e-4;
  ModelOptions model;
  model.viscous_friction = model.coulomb_friction = JointVector::Zero(1);
  AuditOptions options;
  options.mode = Mode::kJoint;
  options.gains.joint_stiffness = JointMatrix::Constant(1, 1, kSpring);
  options.gains.joint_damping = JointMatrix::Constant(1, 1, kDamper);
  options.period = kPeriod;
  const RobotModel arm = testing::chain_of({"continuous"}, model);
  const JointVector q = JointVector::Zero(1);
  options.integral_time = 0.9 * kInertia / kDamper;
  EXPECT_LT(Audit(arm, options).numbers(q).gain_margin, 1);
  options.integral_time = 0.5;
  const PostureAudit found = Audit(arm, options).audit(q);
  EXPECT_NEAR(found.numbers.gain_margin, 2 * kInertia / (kDamper * kPeriod), 1);
  ASSERT_EQ(found.integral_decays.size(), 1U);
  double root = -1 / options.integral_time;
  for (int i = 0; i < 20; ++i) {
    const double value =
        ((kInertia * root + kDamper) * root + kSpring) * root + kSpring / options.integral_time;
    root -= value / ((3 * kInertia * root + 2 * kDamper) * root + kSpring);
  }
  EXPECT_NEAR(found.integral_decays[0], -root, 2e-4 * -root);
  // Without a period there is no loop that it could be in.
  options.period = 0;
  EXPECT_TRUE(Audit(arm, options).audit(q).integral_decays.empty());
}

}  // namespace
}  // namespace dashpot::controller
