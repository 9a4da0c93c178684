// The design of joint damping in the control loop, and what friction leaves to do, beside the
// design of set-up time, which is another algorithm in another precision.
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/ratio_damping.hpp>
#include <dashpot/tests/support/count_allocations.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random_arms.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::graded;
using testing::near;
using testing::padded;
using testing::Random;
using Matrix = Square<kMaxDof>;

TaskImpedance random_joints(Random& random, int n) {
  TaskImpedance arm;
  arm.mass = graded(random, n, 3, random.log_uniform(1, 1e4));
  arm.stiffness = graded(random, n, 3000, random.log_uniform(1, 1e4));
  return arm;
}

RatioDamping damper_of(const TaskImpedance& arm, double ratio) {
  RatioDamping damper;
  damper.set_target(DampingTarget::constant(ratio));
  EXPECT_EQ(damper.set_stiffness(Matrix(*arm.stiffness)), Status::kOk);
  if (arm.damping) damper.set_friction(Vector<kMaxDof>(arm.damping->diagonal()));
  return damper;
}

/// To rounding.
void expect_semidefinite(const MatrixXd& C) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(C, Eigen::EigenvaluesOnly);
  EXPECT_GE(eigen.eigenvalues()[0], -1e-12 * (1e-3 + C.norm()));
}

TEST(RatioDampingOfJoints, MatchesTheDesignOfSetUpTime) {
  Random random(7301);
  int overdone = 0, beside = 0;
  for (int i = 0; i < 300; ++i) {
    const int n = random.integer(1, kMaxDof);
    TaskImpedance arm = random_joints(random, n);
    if (i % 3 > 0) arm.damping = testing::random_friction(random, n, random.log_uniform(0.1, 300));
    const double ratio = random.log_uniform(0.1, 2);
    const DampingDesign design = design_damping(arm, DampingTarget::constant(ratio));
    RatioDamping damper = damper_of(arm, ratio);
    Matrix C(n, n);
    ASSERT_EQ(damper.update(Matrix(arm.mass), C), Status::kOk);
    EXPECT_EQ(C, Matrix(C.transpose()));
    EXPECT_EQ(damper.overdone(), design.indefinite_by < 0);
    if (arm.damping) ++(damper.overdone() ? overdone : beside);
    expect_semidefinite(C);
    if (damper.overdone()) continue;
    ASSERT_LE((MatrixXd(C) - design.damping).norm(), 1e-9 * (1e-3 + design.damping.norm()))
        << "system " << i << ", n = " << n;
  }
  EXPECT_GT(overdone, 25);
  EXPECT_GT(beside, 25);
}

TEST(RatioDampingOfJoints, SaysWhatIsWrongAndKeepsTheDampingBefore) {
  Random random(7303);
  const TaskImpedance arm = random_joints(random, 4);
  RatioDamping damper = damper_of(arm, 0.7);
  Matrix C(4, 4), small(3, 3);
  ASSERT_EQ(damper.update(Matrix(arm.mass), C), Status::kOk);
  const Matrix good = C;
  Matrix broken = arm.mass;
  broken(2, 2) = -1;
  EXPECT_EQ(damper.update(broken, C), Status::kMassNotPositiveDefinite);
  EXPECT_EQ(damper.update(Matrix(Matrix::Identity(3, 3)), C), Status::kWrongSize);
  EXPECT_EQ(damper.update(Matrix(arm.mass), small), Status::kWrongSize);
  EXPECT_EQ(damper.set_stiffness(Matrix(2, 3)), Status::kWrongSize);
  Matrix indefinite = *arm.stiffness;
  indefinite(1, 1) = -1;
  EXPECT_EQ(damper.set_stiffness(indefinite), Status::kStiffnessIndefinite);
  indefinite(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(damper.set_stiffness(indefinite), Status::kNotFinite);
  damper.set_friction(VectorXd::Ones(3));
  EXPECT_EQ(damper.update(Matrix(arm.mass), C), Status::kWrongSize);
  EXPECT_EQ(C, good);
}

TEST(RatioDampingOfJoints, NeverAllocates) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  Random random(7304);
  for (const double friction : {0.0, 1.0, 1000.0}) {  // the last one overdoes it
    TaskImpedance arm = random_joints(random, kMaxDof);
    arm.damping = friction * MatrixXd::Identity(kMaxDof, kMaxDof);
    RatioDamping damper = damper_of(arm, 0.7);
    const Matrix M = arm.mass;
    Matrix C(kMaxDof, kMaxDof);
    EXPECT_EQ(testing::allocations_of([&] { damper.update(M, C); }), 0);
    EXPECT_EQ(damper.overdone(), friction > 100);
  }
}

// As many joints as directions: nothing couples, and both are exact unless friction is too much.
TEST(RatioDampingBesideFriction, MatchesTheDesignOfSetUpTime) {
  Random random(7305);
  int overdone = 0;
  for (int i = 0; i < 300; ++i) {
    const int n = random.integer(1, 6);
    TaskImpedance arm = testing::random_arm(random, n, n);
    arm.damping = testing::random_friction(random, n, random.log_uniform(0.01, 100));
    const DampingTarget target = DampingTarget::constant(random.log_uniform(0.1, 2));
    const DampingDesign design = design_damping(arm, target);
    RatioDamping damper(target);
    damper.set_friction(Vector<kMaxDof>(arm.damping->diagonal()));
    ASSERT_EQ(damper.set_stiffness(padded(*arm.task_stiffness)), Status::kOk);
    TaskJacobian<kMaxDof> J = TaskJacobian<kMaxDof>::Zero(6, n);
    J.topRows(n) = *arm.jacobian;
    TaskMatrix C_C;
    ASSERT_EQ(damper.update(arm.mass, J, C_C), Status::kOk);
    EXPECT_EQ(C_C, TaskMatrix(C_C.transpose()));
    EXPECT_EQ(damper.overdone(), design.indefinite_by < 0);
    overdone += damper.overdone() ? 1 : 0;
    expect_semidefinite(C_C);
    if (damper.overdone()) continue;
    ASSERT_LE((MatrixXd(C_C) - padded(design.damping)).norm(),
              1e-9 * (1e-3 + design.damping.norm()))
        << "system " << i << ", n = " << n;
  }
  EXPECT_GT(overdone, 50);
  EXPECT_LT(overdone, 250);
}

}  // namespace
}  // namespace dashpot::analysis
