// What gains do on an arm: against the companion matrix in long double, and closed forms.
#include <dashpot/tests/controller/audited_panda.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/chains.hpp>

#include <gmock/gmock.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <stdexcept>

namespace dashpot::controller {
namespace {

/// Smallest ratio of the complex eigenvalues, and the smallest real part.
PostureNumbers numbers_of(const TaskLoop& loop) {
  const Eigen::Index n = loop.M.rows();
  LongRows A = LongRows::Zero(2 * n, 2 * n);
  A.topRightCorner(n, n).setIdentity();
  const Eigen::PartialPivLU<LongRows> mass(loop.M);
  A.bottomLeftCorner(n, n) = -mass.solve(loop.K);
  A.bottomRightCorner(n, n) = -mass.solve(loop.C);
  const Eigen::EigenSolver<LongRows> solver(A, false);
  PostureNumbers numbers;
  numbers.smallest_ratio = numbers.fastest_pole = std::numeric_limits<double>::infinity();
  for (const std::complex<long double> value : solver.eigenvalues()) {
    numbers.fastest_pole = std::min(numbers.fastest_pole, static_cast<double>(value.real()));
    if (std::abs(value) < 0.1L || std::abs(value.imag()) < 1e-6L * std::abs(value)) continue;
    numbers.smallest_ratio =
        std::min(numbers.smallest_ratio, static_cast<double>(-value.real() / std::abs(value)));
  }
  return numbers;
}

TEST(Audit, AgreesWithTheCompanionMatrixOverTheWorkspace) {
  for (const double friction : {0.0, 0.5}) {
    const RobotModel model = audited_panda(friction);
    AuditOptions options = stated(kTranslationFirst, 2);
    options.half_quaternion = true;
    const Audit audit(model, options);
    Matrix6 stiffness = options.gains.task_stiffness;
    stiffness.bottomRightCorner<3, 3>() *= 0.5;
    const std::vector<PostureNumbers> found = audit.sample(7, 0, 200);
    for (std::int64_t i = 0; i < 200; ++i) {
      const PostureNumbers& one = found[static_cast<std::size_t>(i)];
      if (one.singular) continue;
      const PostureNumbers expected =
          numbers_of(loop_at(model, audit.posture(7, i), stiffness, options.gains.task_damping));
      EXPECT_NEAR(one.smallest_ratio, expected.smallest_ratio, 1e-9) << i;
      EXPECT_NEAR(one.fastest_pole, expected.fastest_pole, 1e-9 * std::abs(expected.fastest_pole));
    }
  }
}

TEST(Audit, ProvesBoundsThatHold) {
  const RobotModel model = audited_panda();
  const AuditOptions options = stated(kTranslationFirst, 2);
  const PostureAudit found = Audit(model, options).audit(home());
  const PostureNumbers expected =
      numbers_of(loop_at(model, home(), options.gains.task_stiffness, options.gains.task_damping));
  EXPECT_LT(found.smallest_ratio_bound, 1e-10);
  EXPECT_LT(found.fastest_pole_bound, 1e-8);
  EXPECT_NEAR(found.numbers.smallest_ratio, expected.smallest_ratio, found.smallest_ratio_bound);
  EXPECT_NEAR(found.numbers.fastest_pole, expected.fastest_pole, found.fastest_pole_bound + 1e-9);
  EXPECT_EQ(found.numbers.zero_modes, 1);
}

/// F = blkdiag(L_v, L_w) (K e + D v) turns with neither frame nor order of the joints.
TEST(Audit, ScalesGainsByTheInertiaOfTheTip) {
  const RobotModel model = audited_panda();
  AuditOptions options = stated((Vector6() << 150, 150, 150, 250, 250, 250).finished(), 2);
  options.inertia_blocks = true;
  const DynamicsResult robot = evaluate(model, home(), JointVector::Zero(7));
  const Eigen::MatrixXd mobility =
      robot.J * Eigen::MatrixXd(robot.M).inverse() * robot.J.transpose();
  Matrix6 inertia = Matrix6::Zero();
  inertia.topLeftCorner<3, 3>() = Eigen::Matrix3d(mobility.topLeftCorner<3, 3>()).inverse();
  inertia.bottomRightCorner<3, 3>() = Eigen::Matrix3d(mobility.bottomRightCorner<3, 3>()).inverse();
  const Matrix6 K = options.gains.task_stiffness, C = options.gains.task_damping;
  const PostureNumbers expected = numbers_of(loop_at(model, home(), K * inertia, C * inertia));
  for (const Frame frame : {Frame::kBase, Frame::kTool}) {
    options.gains.frame = frame;
    const PostureNumbers found = Audit(model, options).numbers(home());
    EXPECT_NEAR(found.smallest_ratio, expected.smallest_ratio, 1e-9);
    EXPECT_NEAR(found.fastest_pole, expected.fastest_pole, 1e-9 * std::abs(expected.fastest_pole));
  }
}

/// With springs and dampers that are the same for all joints, the self-motion z (J z = 0) has
/// omega^2 = k z'z / z'Mz and the ratio c z'z / (2 omega z'Mz).
TEST(Audit, CountsSpringsInTheNullSpace) {
  constexpr double kSpring = 5, kDamper = 0.1;
  const RobotModel model = audited_panda();
  AuditOptions options = stated(kTranslationFirst, 2);
  options.gains.null_stiffness = JointVector::Constant(7, kSpring);
  options.gains.null_damping = JointVector::Constant(7, kDamper);
  const Audit audit(model, options);
  const PostureNumbers fast = audit.numbers(home());
  const PostureAudit proved = audit.audit(home());
  EXPECT_EQ(fast.zero_modes, 0);
  EXPECT_EQ(proved.spectrum.modes.size(), 7);
  const DynamicsResult robot = evaluate(model, home(), JointVector::Zero(7));
  const Eigen::VectorXd z = Eigen::FullPivLU<Eigen::MatrixXd>(robot.J).kernel().col(0);
  const double per_mass = z.squaredNorm() / z.dot(Eigen::MatrixXd(robot.M) * z);
  const double ratio = 0.5 * kDamper * std::sqrt(per_mass / kSpring);
  EXPECT_NEAR(fast.smallest_ratio, ratio, 1e-9);
  EXPECT_NEAR(proved.numbers.smallest_ratio, ratio, 1e-9);
  EXPECT_NEAR(fast.fastest_pole, proved.numbers.fastest_pole, 1e-6);
  options.gains.null_stiffness = {};
  EXPECT_EQ(Audit(model, options).numbers(home()).zero_modes, 1);
}

TEST(Audit, TakesTheProjectorOfThePseudoInverse) {
  const RobotModel model = audited_panda();
  AuditOptions options = stated(kTranslationFirst, 2);
  options.gains.null_stiffness = JointVector::Constant(7, 10);
  options.gains.null_damping = JointVector::Constant(7, 6);
  options.kinematic_null_space = true;
  const Audit audit(model, options);
  for (int k = 0; k < 50; ++k) {
    const JointVector q = audit.posture(1, k);
    TaskLoop loop = loop_at(model, q, options.gains.task_stiffness, options.gains.task_damping);
    const Eigen::MatrixXd J = evaluate(model, q, JointVector::Zero(7)).J;
    const LongRows z = Eigen::FullPivLU<LongRows>(J.cast<long double>()).kernel();
    const LongRows N = z * z.transpose() / z.squaredNorm();
    loop.K += 10 * N, loop.C += 6 * N;
    const PostureNumbers wanted = numbers_of(loop);
    for (const PostureNumbers& found : {audit.numbers(q), audit.audit(q).numbers}) {
      EXPECT_NEAR(found.fastest_pole, wanted.fastest_pole, 1e-9 * std::abs(wanted.fastest_pole));
      EXPECT_NEAR(found.smallest_ratio, wanted.smallest_ratio, 1e-8);
    }
  }
}

TEST(Audit, NamesASingularPosture) {
  JointVector stretched = home();
  stretched[1] = stretched[3] = stretched[5] = 0;
  const Audit audit(audited_panda(), stated(kTranslationFirst, 2));
  EXPECT_TRUE(audit.numbers(stretched).singular);
  EXPECT_FALSE(audit.numbers(home()).singular);
  EXPECT_GT(audit.numbers(stretched).zero_modes, 1);
}

TEST(Audit, DrawsPosturesByNumberAlone) {
  const Audit audit(audited_panda(), stated(kTranslationFirst, 2));
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

TEST(Audit, SummarizesByNearestRank) {
  const Audit audit(audited_panda(), stated(kTranslationFirst, 2));
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
}

TEST(Audit, SuggestsDampingThatGivesTheRatio) {
  AuditOptions options = stated(kTranslationFirst, 2);
  const DampingSuggestion found = Audit(audited_panda(), options).suggest(home(), 0.6);
  options.gains.task_damping = found.damping;
  const PostureAudit with = Audit(audited_panda(), options).audit(home());
  for (const analysis::Mode<>& mode : with.spectrum.modes) {
    EXPECT_NEAR(mode.damping_ratio, 0.6, 1e-8);
  }
  EXPECT_EQ(found.diagonal, Eigen::VectorXd(found.damping.diagonal()));
  options.gains.task_damping = Matrix6(found.diagonal.asDiagonal());
  EXPECT_NEAR(Audit(audited_panda(), options).audit(home()).numbers.smallest_ratio,
              found.diagonal_smallest_ratio, 1e-9);
}

void expect_refusal(const AuditOptions& options, const std::string& words) {
  try {
    const Audit audit(audited_panda(), options);
    FAIL() << "not refused: " << words;
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(words));
  }
}

TEST(Audit, RefusesGainsThatCannotBe) {
  const AuditOptions good = stated(kTranslationFirst, 2);
  AuditOptions bad = good;
  bad.gains.task_stiffness(0, 0) = -1;
  expect_refusal(bad, "task_stiffness: is not positive semidefinite");
  bad = good;
  bad.gains.task_damping(0, 1) = 1;
  expect_refusal(bad, "task_damping: is not symmetric");
  bad = good;
  bad.gains.task_damping(2, 2) = std::numeric_limits<double>::quiet_NaN();
  expect_refusal(bad, "task_damping: has an entry that is not a finite number");
  bad = good;
  bad.gains.null_stiffness = JointVector::Zero(6);
  expect_refusal(bad, "null_stiffness: has 6 entries, expected 7");
  bad = good;
  bad.gains.task_stiffness(1, 1) = 3;
  bad.inertia_blocks = true;
  expect_refusal(bad, "task_stiffness: needs one number for translation");
  bad = good;
  bad.period = -1;
  expect_refusal(bad, "period");
  bad = good;
  bad.integral_time = std::numeric_limits<double>::quiet_NaN();
  expect_refusal(bad, "integral_time");
  EXPECT_THROW(Audit(audited_panda(), good).numbers(JointVector::Zero(6)), std::invalid_argument);
}

}  // namespace
}  // namespace dashpot::controller
