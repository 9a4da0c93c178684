// The words in which to_joint_space() refuses an impedance.
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/random_impedance.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::kNan;

std::string refusal(const TaskImpedance& impedance) {
  try {
    to_joint_space(impedance);
    return "";
  } catch (const InvalidSystem& error) {
    return error.what();
  }
}

TEST(ToJointSpace, NamesTheMemberThatIsMissing) {
  testing::Random random(28);
  const TaskImpedance whole = testing::random_impedance(random, 3, 2);
  TaskImpedance impedance = whole;
  impedance.jacobian.reset();
  EXPECT_EQ(refusal(impedance), "task_damping: needs a jacobian");
  impedance.task_damping.reset();
  EXPECT_EQ(refusal(impedance), "task_stiffness: needs a jacobian");

  impedance = whole;
  impedance.task_stiffness.reset();
  EXPECT_EQ(refusal(impedance), "");
  impedance.task_damping.reset();
  EXPECT_EQ(refusal(impedance), "jacobian: needs task_damping or task_stiffness");

  impedance = whole;
  impedance.jacobian_rate = random.matrix(2, 3);
  impedance.task_damping.reset();
  EXPECT_EQ(refusal(impedance), "jacobian_rate: needs task_damping");

  impedance = whole;
  impedance.wrench = random.vector(2);
  EXPECT_EQ(refusal(impedance), "wrench: needs jacobian_derivatives");
  impedance.wrench.reset();
  impedance.jacobian_derivatives.assign(3, random.matrix(2, 3));
  EXPECT_EQ(refusal(impedance), "jacobian_derivatives: needs a wrench");
}

TEST(ToJointSpace, NamesTheMemberOfWrongSize) {
  testing::Random random(29);
  const TaskImpedance whole = testing::random_impedance(random, 3, 2);
  TaskImpedance impedance = whole;
  impedance.mass = random.matrix(3, 2);
  EXPECT_EQ(refusal(impedance), "mass: is 3 x 2, expected 3 x 3");
  impedance = whole;
  impedance.jacobian = random.matrix(2, 4);
  EXPECT_EQ(refusal(impedance), "jacobian: is 2 x 4, expected 2 x 3");
  impedance = whole;
  impedance.task_stiffness = random.spd(3);
  EXPECT_EQ(refusal(impedance), "task_stiffness: is 3 x 3, expected 2 x 2");
  impedance = whole;
  impedance.task_damping = random.spd(1);
  EXPECT_EQ(refusal(impedance), "task_damping: is 1 x 1, expected 2 x 2");
  impedance = whole;
  impedance.damping = random.spd(2);
  EXPECT_EQ(refusal(impedance), "damping: is 2 x 2, expected 3 x 3");
  impedance = whole;
  impedance.jacobian_rate = random.matrix(1, 3);
  EXPECT_EQ(refusal(impedance), "jacobian_rate: is 1 x 3, expected 2 x 3");
  impedance = whole;
  impedance.wrench = random.vector(2);
  impedance.jacobian_derivatives.assign(2, random.matrix(2, 3));
  EXPECT_EQ(refusal(impedance), "jacobian_derivatives: has 2 matrices, expected 3");
  impedance.jacobian_derivatives = {random.matrix(2, 3), random.matrix(1, 3), random.matrix(2, 3)};
  EXPECT_EQ(refusal(impedance), "jacobian_derivatives[2]: is 1 x 3, expected 2 x 3");
  impedance.wrench = random.vector(3);
  EXPECT_EQ(refusal(impedance), "wrench: is 3 x 1, expected 2 x 1");
}

TEST(ToJointSpace, NamesTheMemberThatIsNotFiniteOrNotSymmetric) {
  testing::Random random(30);
  const TaskImpedance whole = testing::random_impedance(random, 3, 2);
  TaskImpedance impedance = whole;
  (*impedance.jacobian)(1, 2) = kNan;
  EXPECT_EQ(refusal(impedance), "jacobian: entry (2,3) is not a finite number");
  impedance = whole;
  (*impedance.task_damping)(0, 0) = kNan;
  EXPECT_EQ(refusal(impedance), "task_damping: entry (1,1) is not a finite number");
  impedance = whole;
  impedance.wrench = VectorXd::Constant(2, kNan);
  impedance.jacobian_derivatives.assign(3, random.matrix(2, 3));
  EXPECT_EQ(refusal(impedance), "wrench: entry (1,1) is not a finite number");
  impedance = whole;
  impedance.task_stiffness = (MatrixXd(2, 2) << 5, 3, 4, 5).finished();
  EXPECT_EQ(refusal(impedance),
            "task_stiffness: is not symmetric: entry (1,2) is 3, entry (2,1) is 4");
  impedance = whole;
  impedance.mass = -MatrixXd::Identity(3, 3);
  EXPECT_EQ(refusal(impedance), "mass: is not positive definite");
}

}  // namespace
}  // namespace dashpot::analysis
