// Results of gains on an arm, against eigenvalues in long double, and closed forms. Margins are
// compared with the loop at a posture (tests/threads/one_loop_test.cpp), which
// tests/sim/loop_stability_test.cpp steps tick by tick.
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/default_settings.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/chains.hpp>
#include <dashpot/tests/support/simulated_arm.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

namespace dashpot::controller {
namespace {

using Eigen::MatrixXd;
using TaskLoop = analysis::System<>;
using testing::kInfinity;
using testing::kLinkInertia;
using testing::panda_ready;

const Vector6 kTranslationFirst = (Vector6() << 200, 200, 200, 20, 20, 20).finished();

RobotModel audited_panda(double friction = 0) {
  ModelOptions options;
  options.viscous_friction = JointVector::Constant(7, friction);
  return testing::arm_model(testing::arms()[0], options);
}

AuditOptions stated(const Vector6& stiffness, double factor) {
  AuditOptions options;
  options.gains.task_stiffness = stiffness.asDiagonal();
  options.gains.task_damping = Vector6(factor * stiffness.cwiseSqrt()).asDiagonal();
  return options;
}

/// The closed loop of task gains.
TaskLoop loop_at(const RobotModel& model, const JointVector& q, const Matrix6& stiffness,
                 const Matrix6& damping) {
  const DynamicsResult robot = evaluate(model, q, JointVector::Zero(q.size()));
  const MatrixXd J = robot.J;
  TaskLoop loop =
      testing::system_from(robot.M, J.transpose() * damping * J, J.transpose() * stiffness * J);
  loop.damping.diagonal() += model.joint_values(&Joint::viscous_friction);
  return loop;
}

/// Expects the smallest ratio of the complex eigenvalues, and the smallest real part.
void expect_numbers(const PostureNumbers& found, const TaskLoop& loop, double ratio_error = 1e-9,
                    double pole_error = 0) {
  double ratio = kInfinity, pole = kInfinity;
  for (const testing::LongComplex value : testing::true_eigenvalues(loop)) {
    pole = std::min(pole, static_cast<double>(value.real()));
    if (std::abs(value) < 0.1L || std::abs(value.imag()) < 1e-6L * std::abs(value)) continue;
    ratio = std::min(ratio, static_cast<double>(-value.real() / std::abs(value)));
  }
  EXPECT_NEAR(found.smallest_ratio, ratio, ratio_error);
  EXPECT_NEAR(found.fastest_pole, pole, pole_error > 0 ? pole_error : 1e-9 * std::abs(pole));
}

TaskLoop loop_at(const RobotModel& model, const JointVector& q, const AuditOptions& options) {
  return loop_at(model, q, options.gains.task_stiffness, options.gains.task_damping);
}

class AuditOfPanda : public ::testing::Test {
 protected:
  PostureNumbers numbers() const { return Audit(model, options).numbers(home); }
  PostureAudit audited() const { return Audit(model, options).audit(home); }

  RobotModel model = audited_panda();
  AuditOptions options = stated(kTranslationFirst, 2);
  const JointVector home = panda_ready();
};

TEST_F(AuditOfPanda, AgreesWithTheEigenvaluesOverTheWorkspace) {
  for (const double friction : {0.0, 0.5}) {
    const RobotModel model = audited_panda(friction);
    options.half_quaternion = true;
    const Audit audit(model, options);
    Matrix6 stiffness = options.gains.task_stiffness;
    stiffness.bottomRightCorner<3, 3>() *= 0.5;
    const std::vector<PostureNumbers> found = audit.sample(7, 0, 100);
    for (std::int64_t i = 0; i < 100; ++i) {
      SCOPED_TRACE(i);
      const PostureNumbers& one = found[static_cast<std::size_t>(i)];
      if (one.singular) continue;
      expect_numbers(one,
                     loop_at(model, audit.posture(7, i), stiffness, options.gains.task_damping));
    }
  }
}

TEST_F(AuditOfPanda, TakesAnotherLoopAndTellsItsOwnMatrices) {
  const RobotModel model = audited_panda(0.5);
  const Audit audit(model, stated(kTranslationFirst, 2));
  Settings settings = default_settings(model);
  Gains& gains = settings.initial.gains;
  gains.task_stiffness = kTranslationFirst.asDiagonal();
  gains.task_damping_ratio = 0.7;
  gains.null_damping_ratio = 0;
  gains.null_stiffness.setZero(7);
  gains.null_damping.setZero(7);
  LoopAt designed = PostureLoop(model, settings).at(panda_ready(), gains, Mode::kCartesian);
  const std::optional<PostureNumbers> numbers = audit.numbers(designed);
  ASSERT_TRUE(numbers);
  expect_numbers(*numbers, designed.system);
  designed.system.stiffness_factor.resize(0, 7);
  EXPECT_FALSE(audit.numbers(designed));

  const TaskLoop own = analysis::to_joint_space(audit.impedance(panda_ready()));
  expect_numbers(audit.numbers(panda_ready()), own);
}

TEST_F(AuditOfPanda, ProvesBoundsThatHold) {
  const PostureAudit found = audited();
  EXPECT_LT(found.smallest_ratio_bound, 1e-10);
  EXPECT_LT(found.fastest_pole_bound, 1e-8);
  expect_numbers(found.numbers, loop_at(model, home, options), found.smallest_ratio_bound,
                 found.fastest_pole_bound + 1e-9);
  EXPECT_EQ(found.numbers.zero_modes, 1);
}

/// F = blkdiag(L_v, L_w) (K e + D v) turns with neither frame nor order of the joints.
TEST_F(AuditOfPanda, ScalesGainsByTheInertiaOfTheTip) {
  options = stated((Vector6() << 150, 150, 150, 250, 250, 250).finished(), 2);
  options.inertia_blocks = true;
  const DynamicsResult robot = evaluate(model, home, JointVector::Zero(7));
  const MatrixXd mobility = robot.J * MatrixXd(robot.M).inverse() * robot.J.transpose();
  Matrix6 inertia = Matrix6::Zero();
  inertia.topLeftCorner<3, 3>() = Eigen::Matrix3d(mobility.topLeftCorner<3, 3>()).inverse();
  inertia.bottomRightCorner<3, 3>() = Eigen::Matrix3d(mobility.bottomRightCorner<3, 3>()).inverse();
  const Matrix6 K = options.gains.task_stiffness, C = options.gains.task_damping;
  const TaskLoop expected = loop_at(model, home, inertia * options.gains.task_stiffness,
                                    inertia * options.gains.task_damping);
  for (const Frame frame : {Frame::kBase, Frame::kTool}) {
    options.gains.frame = frame;
    expect_numbers(numbers(), expected);
  }
}

/// With springs and dampers that are the same for all joints, the self-motion z (J z = 0) has
/// omega^2 = k z'z / z'Mz and the ratio c z'z / (2 omega z'Mz).
TEST_F(AuditOfPanda, CountsSpringsInTheNullSpace) {
  constexpr double kSpring = 5, kDamper = 0.1;
  options.gains.null_stiffness = JointVector::Constant(7, kSpring);
  options.gains.null_damping = JointVector::Constant(7, kDamper);
  const Audit audit(model, options);
  const PostureNumbers fast = audit.numbers(home);
  const PostureAudit proved = audit.audit(home);
  EXPECT_EQ(fast.zero_modes, 0);
  EXPECT_EQ(proved.spectrum.modes.size(), 7);
  const DynamicsResult robot = evaluate(model, home, JointVector::Zero(7));
  const Eigen::VectorXd z = Eigen::FullPivLU<MatrixXd>(robot.J).kernel().col(0);
  const double per_mass = z.squaredNorm() / z.dot(MatrixXd(robot.M) * z);
  const double ratio = 0.5 * kDamper * std::sqrt(per_mass / kSpring);
  EXPECT_NEAR(fast.smallest_ratio, ratio, 1e-9);
  EXPECT_NEAR(proved.numbers.smallest_ratio, ratio, 1e-9);
  EXPECT_NEAR(fast.fastest_pole, proved.numbers.fastest_pole, 1e-6);
  options.gains.null_stiffness = {};
  EXPECT_EQ(numbers().zero_modes, 1);
}

TEST_F(AuditOfPanda, TakesProjectorsOfPseudoInverses) {
  options.gains.null_stiffness = JointVector::Constant(7, 10);
  options.gains.null_damping = JointVector::Constant(7, 6);
  for (const NullProjector projector : {NullProjector::kKinematic, NullProjector::kWeighted}) {
    options.gains.null_projector = projector;
    const bool weighted = projector == NullProjector::kWeighted;
    if (weighted) options.null_weights = JointVector::LinSpaced(7, 0.3, 3);
    const MatrixXd W =
        weighted ? MatrixXd(options.null_weights.asDiagonal()) : MatrixXd::Identity(7, 7);
    const Audit audit(model, options);
    for (int k = 0; k < 50; ++k) {
      const JointVector q = audit.posture(1, k);
      TaskLoop loop = loop_at(model, q, options);
      const MatrixXd z =
          Eigen::FullPivLU<MatrixXd>(evaluate(model, q, JointVector::Zero(7)).J).kernel();
      const MatrixXd N = z * (z.transpose() * W * z).inverse() * z.transpose() * W;
      loop.stiffness += 10 * N.transpose() * N;
      loop.damping += 6 * N.transpose() * N;
      expect_numbers(audit.numbers(q), loop, 1e-8);
      expect_numbers(audit.audit(q).numbers, loop, 1e-8);
    }
  }
  options.null_weights = JointVector::Zero(7);
  EXPECT_THROW(Audit(model, options), std::invalid_argument);
}

TEST_F(AuditOfPanda, TakesSpringsOfTipAndJointsAtOnce) {
  options.gains.null_stiffness = JointVector::LinSpaced(7, 40, 10);
  options.gains.null_damping = JointVector::LinSpaced(7, 6, 1);
  options.gains.null_projector = NullProjector::kNone;
  const Audit audit(model, options);
  for (int k = 0; k < 50; ++k) {
    const JointVector q = audit.posture(1, k);
    TaskLoop loop = loop_at(model, q, options);
    loop.stiffness += options.gains.null_stiffness.asDiagonal();
    loop.damping += options.gains.null_damping.asDiagonal();
    expect_numbers(audit.numbers(q), loop, 1e-8);
    expect_numbers(audit.audit(q).numbers, loop, 1e-8);
  }
}

TEST_F(AuditOfPanda, NamesASingularPosture) {
  JointVector stretched = home;
  stretched[1] = stretched[3] = stretched[5] = 0;
  const Audit audit(model, options);
  EXPECT_TRUE(audit.numbers(stretched).singular);
  EXPECT_FALSE(audit.numbers(home).singular);
  EXPECT_GT(audit.numbers(stretched).zero_modes, 1);
}

TEST_F(AuditOfPanda, DrawsPosturesByNumberAlone) {
  const Audit audit(model, options);
  const std::vector<PostureNumbers> all = audit.sample(3, 0, 90);
  const std::vector<PostureNumbers> part = audit.sample(3, 40, 10);
  for (std::size_t i = 0; i < part.size(); ++i) {
    EXPECT_EQ(part[i].smallest_ratio, all[40 + i].smallest_ratio);
    EXPECT_EQ(part[i].fastest_pole, all[40 + i].fastest_pole);
  }
  EXPECT_NE(audit.posture(3, 0), audit.posture(4, 0));
  const JointVector lower = audit.options().lower, upper = audit.options().upper;
  for (std::int64_t i = 0; i < 90; ++i) {
    EXPECT_TRUE((audit.posture(3, i).array() >= lower.array()).all());
    EXPECT_TRUE((audit.posture(3, i).array() <= upper.array()).all());
  }
}

TEST_F(AuditOfPanda, SummarizesByNearestRank) {
  const Audit audit(model, options);
  const std::vector<PostureNumbers> all = audit.sample(5, 0, 101);
  const WorkspaceAudit found =
      summarize(audit, all, [&](std::int64_t i) { return audit.posture(5, i); });
  std::vector<double> ratios, poles;
  for (const PostureNumbers& one : all) {
    ratios.push_back(one.smallest_ratio);
    poles.push_back(one.fastest_pole);
  }
  std::sort(ratios.begin(), ratios.end());
  std::sort(poles.begin(), poles.end());
  EXPECT_EQ(found.samples, 101);
  EXPECT_NEAR(found.smallest_ratio.median, ratios[50], 1e-9);
  EXPECT_NEAR(found.smallest_ratio.p05, ratios[5], 1e-9);
  EXPECT_NEAR(found.smallest_ratio.p95, ratios[95], 1e-9);
  EXPECT_NEAR(found.smallest_ratio.worst, ratios[0], 1e-9);
  EXPECT_NEAR(found.fastest_pole.worst, poles[0], 1e-6);
  EXPECT_NEAR(audit.numbers(found.smallest_ratio.worst_q).smallest_ratio, ratios[0], 1e-9);
  EXPECT_TRUE(std::isnan(found.gain_margin.median));
  EXPECT_LT(found.smallest_ratio.bound, 1e-9);
  EXPECT_GT(found.smallest_ratio.bound, 0);
  EXPECT_TRUE(std::isnan(found.gain_margin.bound));
}

TEST_F(AuditOfPanda, SuggestsDampingThatGivesTheRatio) {
  const DampingSuggestion found = Audit(model, options).suggest(home, 0.6);
  options.gains.task_damping = found.damping;
  const PostureAudit with = audited();
  for (const analysis::Mode<>& mode : with.spectrum.modes) {
    EXPECT_NEAR(mode.damping_ratio, 0.6, 1e-8);
  }
  EXPECT_EQ(found.diagonal, Eigen::VectorXd(found.damping.diagonal()));
  options.gains.task_damping = Matrix6(found.diagonal.asDiagonal());
  EXPECT_NEAR(audited().numbers.smallest_ratio, found.diagonal_smallest_ratio, 1e-9);
}

TEST_F(AuditOfPanda, RefusesGainsThatCannotBe) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const struct {
    std::function<void(AuditOptions&)> spoil;
    const char* words;
  } cases[] = {
      {[](auto& o) { o.gains.task_stiffness(0, 0) = -1; },
       "task_stiffness: is not positive semidefinite"},
      {[](auto& o) { o.gains.task_damping(0, 1) = 1; }, "task_damping: is not symmetric"},
      {[](auto& o) { o.gains.task_damping(2, 2) = kNaN; },
       "task_damping: has an entry that is not a finite number"},
      {[](auto& o) { o.gains.null_stiffness = JointVector::Zero(6); },
       "null_stiffness: has 6 entries, expected 7"},
      {[](auto& o) { o.gains.task_stiffness(1, 1) = 3, o.inertia_blocks = true; },
       "task_stiffness: needs one number for translation"},
      {[](auto& o) { o.period = -1; }, "period"},
      {[](auto& o) { o.delay = -1; }, "delay"},
      {[](auto& o) { o.cutoff = -1; }, "cutoff"},
      {[](auto& o) { o.soft_frequency = 0; }, "soft_frequency"},
      {[](auto& o) { o.lower = JointVector::Zero(3); }, "lower, upper"},
      {[](auto& o) { o.integral_time = kNaN; }, "integral_time"},
  };
  for (const auto& [spoil, words] : cases) {
    options = stated(kTranslationFirst, 2);
    spoil(options);
    EXPECT_THAT([&] { Audit(model, options); },
                ::testing::ThrowsMessage<std::invalid_argument>(::testing::HasSubstr(words)));
  }
  const Audit good(model, stated(kTranslationFirst, 2));
  EXPECT_THROW(good.numbers(JointVector::Zero(6)), std::invalid_argument);
}

/// A link on its own, and its gains.
struct OneLink {
  RobotModel model;
  AuditOptions options;

  OneLink(double spring, double damper, double period) : model(testing::one_link()) {
    options.mode = Mode::kJoint;
    options.gains.joint_stiffness = JointMatrix::Constant(1, 1, spring);
    options.gains.joint_damping = JointMatrix::Constant(1, 1, damper);
    options.period = period;
  }
  PostureNumbers numbers() const { return Audit(model, options).numbers(JointVector::Zero(1)); }
  PostureAudit audit() const { return Audit(model, options).audit(JointVector::Zero(1)); }
};

/// A damper c held for T makes v <- (1 - c T / I) v: stable up to c T / I = 2.
TEST(Audit, FindsPoleAndMarginOfOneJoint) {
  OneLink one(1e-3, 10, 0.001);
  one.options.soft_frequency = 1e-3;
  const PostureNumbers found = one.numbers();
  EXPECT_NEAR(found.fastest_pole, -10 / kLinkInertia, 1e-3);
  EXPECT_NEAR(found.gain_margin, 2 * kLinkInertia / (10 * 0.001), 1e-3);
  EXPECT_NEAR(found.smallest_ratio, 10 / (2 * std::sqrt(1e-3 * kLinkInertia)), 1e-3);
  EXPECT_EQ(found.zero_modes, 0);
}

/// With an integral l is a root of I l^3 + s (c l^2 + k l + k / t): stable for s > I / (c t).
TEST(Audit, FindsSlowModeAndMarginOfOneJointWithAnIntegral) {
  constexpr double kSpring = 20, kDamper = 2, kPeriod = 1e-4;
  OneLink one(kSpring, kDamper, kPeriod);
  double& time = one.options.integral_time;
  time = 0.9 * kLinkInertia / kDamper;
  EXPECT_LT(one.numbers().gain_margin, 1);
  time = 0.5;
  const PostureAudit found = one.audit();
  EXPECT_NEAR(found.numbers.gain_margin, 2 * kLinkInertia / (kDamper * kPeriod), 1);
  ASSERT_EQ(found.integral_decays.size(), 1U);
  const double l = -found.integral_decays[0];
  const double residual = ((kLinkInertia * l + kDamper) * l + kSpring) * l + kSpring / time;
  EXPECT_NEAR(residual / (kSpring / time), 0, 2e-4);
  // Without a period there is no sampled loop.
  one.options.period = 0;
  EXPECT_TRUE(one.audit().integral_decays.empty());
}

}  // namespace
}  // namespace dashpot::controller
