// The design in the control loop, beside the one of set-up time, which is another algorithm in
// another precision.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/design/modal_damping.hpp>
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random_arms.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <limits>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using testing::near;
using testing::padded;
using testing::Random;
using testing::random_arm;

TaskJacobian<kMaxDof> padded_jacobian(const MatrixXd& J) {
  TaskJacobian<kMaxDof> result = TaskJacobian<kMaxDof>::Zero(6, J.cols());
  result.topRows(J.rows()) = J;
  return result;
}

Status update(RatioDamping& damper, const TaskImpedance& arm, TaskMatrix& C_C) {
  return damper.update(arm.mass, padded_jacobian(*arm.jacobian), C_C);
}

/// Matches the design of set-up time, and gives the modes their ratios.
TEST(RatioDamping, MatchesTheDesignOfSetUpTime) {
  Random random(7101);
  for (int i = 0; i < 1000; ++i) {
    const int n = random.integer(1, kMaxDof), m = random.integer(1, 6);
    TaskImpedance arm =
        random_arm(random, n, m, random.log_uniform(1, 1e4), random.log_uniform(1, 1e4));
    const DampingTarget target = DampingTarget::constant(random.log_uniform(0.01, 2));
    RatioDamping damper(target);
    ASSERT_EQ(damper.set_stiffness(padded(*arm.task_stiffness)), Status::kOk);
    TaskMatrix C_C;
    ASSERT_EQ(update(damper, arm, C_C), Status::kOk);
    EXPECT_EQ(C_C, TaskMatrix(C_C.transpose()));
    const MatrixXd expected = padded(design_damping(arm, target).damping);
    ASSERT_LE((C_C - expected).norm(), 1e-10 * expected.norm())
        << "system " << i << ", n = " << n << ", m = " << m;
    if (i % 2 == 1 || n > 9 || m > n) continue;
    arm.task_damping = C_C.topLeftCorner(m, m);
    const Spectrum<> spectrum = analyze(to_joint_space(arm));
    ASSERT_EQ(spectrum.modes.size(), m);
    for (const Mode<>& mode : spectrum.modes) {
      EXPECT_NEAR(mode.damping_ratio, target.ratio, 1e-9);
    }
  }
}

/// An arm that moves along a smooth path; at phase 0 the smallest singular value of J is zero.
TaskImpedance on_path(const TaskImpedance& arm, const MatrixXd& J_swing, double phase) {
  TaskImpedance moved = arm;
  const Eigen::JacobiSVD<MatrixXd> svd(*arm.jacobian, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Index last = svd.singularValues().size() - 1;
  const MatrixXd singular = *arm.jacobian - svd.singularValues()[last] * svd.matrixU().col(last) *
                                                svd.matrixV().col(last).transpose();
  moved.jacobian = singular + std::sin(phase) * J_swing;
  return moved;
}

/// After any number of ticks: it does not drift.
TEST(RatioDamping, StartedFromTheLastConfigurationMatchesAColdStart) {
  Random random(7103);
  const TaskImpedance arm = random_arm(random, 7, 6);
  const MatrixXd swing = 0.5 * random.matrix(6, 7);
  RatioDamping warm(DampingTarget::constant(0.7));
  ASSERT_EQ(warm.set_stiffness(*arm.task_stiffness), Status::kOk);
  TaskMatrix C_warm, C_cold;
  for (int tick = 0; tick < 5000; ++tick) {
    const TaskImpedance moved = on_path(arm, swing, 0.3 + 1e-3 * tick);
    ASSERT_EQ(update(warm, moved, C_warm), Status::kOk);
    if (tick % 3 != 0 && tick < 4900) continue;
    RatioDamping cold(DampingTarget::constant(0.7));
    ASSERT_EQ(cold.set_stiffness(*arm.task_stiffness), Status::kOk);
    ASSERT_EQ(update(cold, moved, C_cold), Status::kOk);
    ASSERT_LE((C_warm - C_cold).norm(), 1e-10 * C_cold.norm()) << tick;
  }
}

// The bound of the header, and no jumps: halving the step halves the largest change.
TEST(RatioDamping, IsBoundedAndSmoothThroughASingularity) {
  Random random(7104);
  const TaskImpedance arm = random_arm(random, 7, 6);
  const MatrixXd swing = 0.5 * random.matrix(6, 7);
  DampingTarget target = DampingTarget::constant(0.7);
  target.soft_frequency = 0.5;
  const double stiffest =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(*arm.task_stiffness).eigenvalues()[5];
  const double bound = 1.4 * DampingTarget::kPeak * stiffest / target.soft_frequency;
  const auto largest_change = [&](double step) {
    RatioDamping damper(target);
    EXPECT_EQ(damper.set_stiffness(*arm.task_stiffness), Status::kOk);
    TaskMatrix C_C, before;
    double change = 0;
    bool first = true;
    for (double phase = -0.02; phase <= 0.02; phase += step) {
      EXPECT_EQ(update(damper, on_path(arm, swing, phase), C_C), Status::kOk);
      EXPECT_LE(C_C.operatorNorm(), bound);
      EXPECT_EQ(negative_eigenvalues(C_C).size(), 0);
      if (!first) change = std::max(change, (C_C - before).norm());
      before = C_C;
      first = false;
    }
    return change;
  };
  const double coarse = largest_change(2e-5), fine = largest_change(1e-5);
  EXPECT_GT(coarse, 0);
  EXPECT_NEAR(fine / coarse, 0.5, 0.02);
  EXPECT_NEAR(largest_change(5e-6) / fine, 0.5, 0.02);
}

// Two frequencies that meet and part again, with shapes that swap.
TEST(RatioDamping, IsSmoothThroughACrossing) {
  Square<kMaxDof> M = Square<kMaxDof>::Identity(6, 6);
  TaskJacobian<kMaxDof> J = TaskJacobian<kMaxDof>::Identity(6, 6);
  TaskMatrix K = TaskMatrix(Eigen::Matrix<double, 6, 1>(100, 100, 400, 9, 25, 49).asDiagonal());
  RatioDamping damper(DampingTarget::constant(0.7));
  ASSERT_EQ(damper.set_stiffness(K), Status::kOk);
  TaskMatrix C_C, before;
  double change = 0;
  for (int i = -1000; i <= 1000; ++i) {
    const double t = 1e-5 * i;
    M(0, 0) = 1 + t;  // the two coincide at t = 0, and veer by the coupling
    M(1, 1) = 1 - t;
    M(0, 1) = M(1, 0) = 1e-7;
    ASSERT_EQ(damper.update(M, J, C_C), Status::kOk);
    if (i > -1000) change = std::max(change, (C_C - before).norm());
    before = C_C;
  }
  EXPECT_LT(change, 1e-5 * C_C.norm());
}

TEST(RatioDamping, ConvergesOnAnythingFinite) {
  Random random(7106);
  for (int i = 0; i < 5000; ++i) {
    const int n = random.integer(1, kMaxDof);
    TaskImpedance arm = random_arm(random, n, 6, random.log_uniform(1, 1e15), 1e12);
    MatrixXd& J = *arm.jacobian;
    for (Eigen::Index row = 0; row < 6; ++row) J.row(row) *= random.log_uniform(1e-12, 1);
    if (i % 3 == 0) J.row(3) = J.row(1);
    if (i % 5 == 0) J.row(2).setZero();
    if (i % 7 == 0) J = J.col(0) * random.matrix(1, n);
    RatioDamping damper(DampingTarget::constant(0.7));
    ASSERT_EQ(damper.set_stiffness(padded(*arm.task_stiffness)), Status::kOk);
    TaskMatrix C_C = TaskMatrix::Zero();
    const Status status = update(damper, arm, C_C);
    ASSERT_TRUE(status == Status::kOk || (arm.mass.llt().info() != Eigen::Success))
        << to_text(status) << ", system " << i;
    ASSERT_TRUE(C_C.allFinite());
    ASSERT_EQ(negative_eigenvalues(C_C).size(), 0) << "system " << i;
  }
}

TEST(RatioDamping, SaysWhatIsWrongAndKeepsTheDampingBefore) {
  Random random(7107);
  const TaskImpedance arm = random_arm(random, 5, 6);
  RatioDamping damper(DampingTarget::constant(0.7));
  ASSERT_EQ(damper.set_stiffness(*arm.task_stiffness), Status::kOk);
  TaskMatrix C_C, before;
  ASSERT_EQ(update(damper, arm, C_C), Status::kOk);
  before = C_C;
  const auto of = [&](const auto& change) {
    TaskImpedance bad = arm;
    change(bad);
    return update(damper, bad, C_C);
  };
  EXPECT_EQ(of([](auto& bad) { bad.mass(4, 4) = -1; }), Status::kMassNotPositiveDefinite);
  for (const double entry :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(of([entry](auto& bad) { (*bad.jacobian)(0, 1) = entry; }), Status::kNotFinite);
  }
  EXPECT_EQ(of([&](auto& bad) { bad.mass = random.spd(4); }), Status::kWrongSize);
  TaskMatrix K = *arm.task_stiffness;
  K(3, 3) = -1;
  EXPECT_EQ(damper.set_stiffness(K), Status::kStiffnessIndefinite);
  K = *arm.task_stiffness;
  K.row(2).setZero();  // a zero pivot beside entries that are not
  K.col(2).setZero();
  K(2, 4) = K(4, 2) = 5;
  EXPECT_EQ(damper.set_stiffness(K), Status::kStiffnessIndefinite);
  K(2, 4) = K(4, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(damper.set_stiffness(K), Status::kNotFinite);
  EXPECT_EQ(C_C, before);
  ASSERT_EQ(update(damper, arm, C_C), Status::kOk);
  EXPECT_TRUE(near(C_C, before, 1e-12 * before.norm()));
}

// With couplings that count in full, R would grow like the inverse of the vanishing frequency.
TEST(MissingDamping, StaysBoundedWhereAModeVanishesBesideFriction) {
  constexpr double kRatio = 0.7, kHard = 20, kSoft = 0.1;
  for (double omega = 5; omega > 1e-6; omega *= 0.7) {
    Vector<kMaxDof> frequencies(2);
    frequencies << kHard, omega;
    Square<kMaxDof> R(2, 2);
    R << 3, 2.9, 2.9, 4;  // the friction there
    bool overdone = false;
    ASSERT_EQ(missing_damping(frequencies, 2 * kRatio * frequencies, kSoft, R, overdone),
              Status::kOk);
    EXPECT_EQ(overdone, omega < 3.1) << omega;
    EXPECT_LE(std::abs(R(0, 1)) * kHard, 6 * kRatio * std::sqrt(3.0 / 4)) << omega;
    EXPECT_GE(R(0, 0), 0);
    EXPECT_GE(R(0, 0) * R(1, 1) - R(0, 1) * R(0, 1), -1e-12) << omega;
  }
}

TEST(MissingDamping, IsExactWhereFrictionLeavesSomething) {
  Vector<kMaxDof> frequencies(2);
  frequencies << 20, 8;
  Square<kMaxDof> R(2, 2);
  R << 3, 2.9, 2.9, 4;
  bool overdone = true;
  ASSERT_EQ(missing_damping(frequencies, 1.4 * frequencies, 1e-3, R, overdone), Status::kOk);
  EXPECT_FALSE(overdone);
  EXPECT_NEAR(R(0, 0), (28 - 3) / 400.0, 1e-15);
  EXPECT_NEAR(R(0, 1), -2.9 / 160.0, 1e-15);
  EXPECT_NEAR(R(1, 1), (11.2 - 4) / 64.0, 1e-15);
}

}  // namespace
}  // namespace dashpot::analysis
