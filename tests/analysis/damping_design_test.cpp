// Full damping matrices for a target ratio, checked by the spectrum that the solver proves.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/paper_examples.hpp>
#include <dashpot/tests/support/random_arms.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::graded;
using testing::near;
using testing::Random;
using testing::random_arm;

double worst_error(const Spectrum<>& spectrum, const DampingTarget& target) {
  double worst = 0;
  for (const Mode<>& mode : spectrum.modes) {
    worst = std::max(worst, std::abs(mode.damping_ratio - target.ratio));
  }
  return worst;
}

MatrixXd root(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A).operatorSqrt();
}

/// A # B = A^1/2 (A^-1/2 B A^-1/2)^1/2 A^1/2
MatrixXd geometric_mean(const MatrixXd& A, const MatrixXd& B) {
  const MatrixXd half = root(A), inverse = half.inverse();
  const MatrixXd inner = inverse * B * inverse;
  return half * root(0.5 * (inner + inner.transpose())) * half;
}

MatrixXd task_inertia(const TaskImpedance& arm) {
  return (*arm.jacobian * arm.mass.llt().solve(arm.jacobian->transpose())).inverse();
}

// The analysis is the judge: its ratios carry proved bounds.
TEST(DampingDesign, GivesEveryModeOfRandomArmsItsRatio) {
  constexpr int kSystems = 2000;
  Random random(7001);
  int redundant = 0;
  for (int i = 0; i < kSystems; ++i) {
    const int n = random.integer(1, 10), m = random.integer(1, std::min(n, 6));
    const bool hard = random.integer(0, 1) == 1;
    const TaskImpedance arm = random_arm(random, n, m, hard ? 1e8 : random.log_uniform(1, 1e8),
                                         hard ? 1e8 : random.log_uniform(1, 1e8));
    DampingTarget target = DampingTarget::constant(random.log_uniform(0.01, 2));
    target.soft_frequency = 1e-9;
    const DampingDesign design = design_damping(arm, target);
    redundant += n > m ? 1 : 0;
    SCOPED_TRACE("system " + std::to_string(i) + ", n = " + std::to_string(n) +
                 ", m = " + std::to_string(m));
    ASSERT_EQ(design.spectrum.modes.size(), m);
    ASSERT_TRUE(design.misses.empty()) << design.misses[0].obtained - design.misses[0].wanted;
    ASSERT_LE(worst_error(design.spectrum, target), 1e-9);
    ASSERT_EQ(design.damping, design.damping.transpose());
    ASSERT_EQ(negative_eigenvalues(design.damping).size(), 0);
  }
  EXPECT_GT(redundant, kSystems / 4);
}

/// The mean is of inertia and stiffness, in task space and in joint space; so it follows a change
/// of task coordinates.
TEST(DampingDesign, IsTheGeometricMeanOfInertiaAndStiffness) {
  Random random(7002);
  const DampingTarget target = DampingTarget::constant(0.7);
  for (int i = 0; i < 20; ++i) {
    const TaskImpedance arm = random_arm(random, 7, 6);
    const MatrixXd Lambda = task_inertia(arm), K = *arm.task_stiffness;
    const MatrixXd C = design_damping(arm, target).damping;
    EXPECT_TRUE(near(C, 1.4 * geometric_mean(Lambda, K), 1e-10 * C.norm()));
    TaskImpedance joints;
    joints.mass = random.spd(6);
    joints.stiffness = graded(random, 6, 500, 100);
    const DampingDesign design = design_damping(joints, target);
    EXPECT_TRUE(design.misses.empty());
    const MatrixXd expected = 1.4 * geometric_mean(joints.mass, *joints.stiffness);
    EXPECT_TRUE(near(design.damping, expected, 1e-10 * expected.norm()));
  }
}

TEST(DampingDesign, LeavesFreeDirectionsFree) {
  Random random(7006);
  TaskImpedance arm = random_arm(random, 7, 6);
  arm.task_stiffness->row(2).setZero();
  arm.task_stiffness->col(2).setZero();
  const DampingDesign design = design_damping(arm, DampingTarget::constant(0.7));
  EXPECT_EQ(design.spectrum.modes.size(), 5);
  EXPECT_EQ(design.spectrum.zero_modes.count, 2);
  EXPECT_TRUE(design.misses.empty());
  EXPECT_TRUE(near(design.damping.col(2), VectorXd::Zero(6), 1e-12));
}

TEST(DampingDesign, CountsFrictionThatIsThereAlready) {
  Random random(7007);
  int reached = 0, overdone = 0;
  for (int i = 0; i < 200; ++i) {
    const int n = random.integer(2, 8);
    TaskImpedance arm = random_arm(random, n, random.integer(1, std::min(n, 6)));
    arm.damping = testing::random_friction(random, n, random.log_uniform(0.1, 1000));
    const DampingTarget target = DampingTarget::constant(0.7);
    const DampingDesign design = design_damping(arm, target);
    SCOPED_TRACE("system " + std::to_string(i));
    EXPECT_EQ(negative_eigenvalues(design.damping).size(), 0);
    if (design.misses.empty()) {
      ++reached;
      EXPECT_LE(worst_error(design.spectrum, target), 1e-9);
      EXPECT_EQ(design.indefinite_by, 0);
    } else {
      ++overdone;
      EXPECT_LT(design.indefinite_by, 0);
      for (const DampingMiss& miss : design.misses) {
        EXPECT_EQ(miss.reason, DampingMiss::Reason::kOverdone);
        EXPECT_EQ(miss.obtained, design.spectrum.modes[miss.mode].damping_ratio);
        EXPECT_EQ(miss.wanted, 0.7);
      }
    }
  }
  EXPECT_GT(reached, 40);
  EXPECT_GT(overdone, 40);
}

// Total damping in modal coordinates: no other PSD matrix comes nearer to the wanted one.
TEST(DampingDesign, IsNearestWhereFrictionOverdoesIt) {
  Random random(7008);
  TaskImpedance arm = random_arm(random, 6, 6);
  arm.damping = testing::random_friction(random, 6, 300);
  const DampingDesign design = design_damping(arm, DampingTarget::constant(0.1));
  ASSERT_LT(design.indefinite_by, 0);
  const MatrixXd& J = *arm.jacobian;
  const MatrixXd K = J.transpose() * *arm.task_stiffness * J;
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> undamped(0.5 * (K + K.transpose()),
                                                                    arm.mass);
  const MatrixXd V = undamped.eigenvectors();
  const VectorXd wanted = 0.2 * undamped.eigenvalues().cwiseSqrt();
  const auto distance = [&](const MatrixXd& C_C) {
    const MatrixXd total = V.transpose() * (*arm.damping + J.transpose() * C_C * J) * V;
    return (total - MatrixXd(wanted.asDiagonal())).norm();
  };
  const double best = distance(design.damping);
  const MatrixXd to_modal = (J * V).inverse();  // of any PSD matrix in modal coordinates
  for (int i = 0; i < 300; ++i) {
    const MatrixXd G = random.matrix(6, 6) * random.log_uniform(1e-6, 1);
    const MatrixXd other = to_modal.transpose() * (G * G.transpose()) * to_modal;
    for (const double part : {1e-3, 0.1, 1.0}) {
      EXPECT_GE(distance((1 - part) * design.damping + part * other), best * (1 - 1e-12));
    }
  }
}

TEST(DampingDesign, StaysBoundedAndNamesSoftModesNextToASingularity) {
  Random random(7009);
  const TaskImpedance arm = random_arm(random, 7, 6);
  const Eigen::JacobiSVD<MatrixXd> svd(*arm.jacobian, Eigen::ComputeThinU | Eigen::ComputeThinV);
  DampingTarget target = DampingTarget::constant(0.7);
  target.soft_frequency = 0.5;
  const double stiffest =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(*arm.task_stiffness).eigenvalues()[5];
  const double bound = 1.4 * DampingTarget::kPeak * stiffest / target.soft_frequency * (1 + 1e-12);
  int soft = 0;
  double largest = 0;
  for (double s = 1; s > 1e-20; s *= 0.7) {
    TaskImpedance singular = arm;
    VectorXd values = svd.singularValues();
    values[5] *= s < 1e-19 ? 0 : s;
    singular.jacobian = svd.matrixU() * values.asDiagonal() * svd.matrixV().transpose();
    const DampingDesign design = design_damping(singular, target);
    const double size = design.damping.operatorNorm();
    largest = std::max(largest, size);
    EXPECT_LE(size, bound);
    EXPECT_EQ(negative_eigenvalues(design.damping).size(), 0);
    for (const DampingMiss& miss : design.misses) {
      EXPECT_EQ(miss.reason, DampingMiss::Reason::kSoft);
      EXPECT_LT(miss.natural_frequency, target.soft_frequency);
      EXPECT_LT(miss.obtained, 0.7);
      EXPECT_GE(miss.obtained, -1e-12);
      ++soft;
    }
  }
  EXPECT_GT(soft, 5);
  EXPECT_GT(largest, 0.02 * bound);  // the bound is within a factor of 50
}

TEST(DampingDesign, RefusesWhatIsNoProblemOfDamping) {
  Random random(7011);
  const DampingTarget target;
  TaskImpedance arm = random_arm(random, 4, 3);
  EXPECT_THROW(design_damping(arm, DampingTarget::constant(-0.1)), std::invalid_argument);
  EXPECT_THROW(design_damping(arm, DampingTarget::constant(std::nan(""))), std::invalid_argument);
  (*arm.task_stiffness)(0, 0) = -1;
  EXPECT_THROW(design_damping(arm, target), InvalidSystem);
  arm.task_stiffness.reset();
  EXPECT_THROW(design_damping(arm, target), InvalidSystem);
  arm.jacobian.reset();
  EXPECT_THROW(design_damping(arm, target), InvalidSystem);
}

}  // namespace
}  // namespace dashpot::analysis
