// Joint-space systems of task-space impedances, exactly, and their factors; and the words in which
// an impedance is refused.
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/paper_examples.hpp>
#include <dashpot/tests/support/random_impedance.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::as_printed;
using testing::kNan;
using testing::near;

// --------------------------------------------------------------------------------- the products

TEST(ToJointSpace, PaperAppendix3DampingAndStiffnessOfTheArm) {
  const System<> system = to_joint_space(testing::paper_baxter());
  EXPECT_TRUE(
      as_printed(system.damping,
                 {{"1.949", "0.07297", "1.305", "0.1258", "0.5526", "0.09194", "0.0000"},
                  {"0.07297", "2.956", "-0.3774", "2.388", "-0.4693", "1.670", "-0.05528"},
                  {"1.305", "-0.3774", "1.963", "-0.3420", "1.623", "-0.3647", "0.1413"},
                  {"0.1258", "2.388", "-0.3420", "2.173", "-0.4543", "1.738", "-0.05528"},
                  {"0.5526", "-0.4693", "1.623", "-0.4543", "1.597", "-0.4639", "0.1625"},
                  {"0.09194", "1.670", "-0.3647", "1.738", "-0.4639", "1.657", "-0.05528"},
                  {"0.0000", "-0.05528", "0.1413", "-0.05528", "0.1625", "-0.05528", "0.01833"}}));
  EXPECT_TRUE(
      as_printed(system.stiffness,
                 {{"162.4", "7.297", "108.7", "12.58", "46.05", "9.194", "0.0000"},
                  {"7.297", "71.02", "3.605", "51.40", "0.5985", "20.69", "-0.1658"},
                  {"108.7", "3.605", "78.97", "7.147", "37.93", "4.876", "0.8012"},
                  {"12.58", "51.40", "7.147", "48.11", "2.098", "27.30", "-0.1658"},
                  {"46.05", "0.5985", "37.93", "2.098", "21.22", "1.136", "0.9211"},
                  {"9.194", "20.69", "4.876", "27.30", "1.136", "21.57", "-0.1658"},
                  {"0.0000", "-0.1658", "0.8012", "-0.1658", "0.9211", "-0.1658", "0.1039"}}));
}

TEST(ToJointSpace, TailsHoldWhatRoundingTook) {
  // Entries are multiples of 2^-30 below 1, so products of three are multiples of 2^-90, which
  // 128-bit integers hold exactly.
  __extension__ using Whole = __int128;
  const auto integer = [](double value, int bits) {
    return static_cast<Whole>(std::ldexp(value, bits));
  };
  testing::Random random(21);
  const auto coarse = [&](int rows, int cols) {
    return MatrixXd(MatrixXd::NullaryExpr(
        rows, cols, [&] { return std::ldexp(random.integer(-(1 << 29), 1 << 29), -30); }));
  };
  TaskImpedance impedance;
  impedance.mass = MatrixXd::Identity(3, 3);
  const MatrixXd J = coarse(2, 3);
  const MatrixXd half = coarse(2, 2);
  const MatrixXd K = half + half.transpose();
  impedance.jacobian = J;
  impedance.task_stiffness = K;
  const System<> system = to_joint_space(impedance);
  ASSERT_TRUE(system.has_low_words);
  EXPECT_FALSE(system.stiffness_low.isZero(0.0));
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      Whole exact = 0;
      for (int k = 0; k < 2; ++k) {
        for (int l = 0; l < 2; ++l) {
          exact += integer(J(k, i), 30) * integer(K(k, l), 30) * integer(J(l, j), 30);
        }
      }
      const double high = system.stiffness(i, j);
      const double low = system.stiffness_low(i, j);
      EXPECT_TRUE(integer(high, 90) + integer(low, 90) == exact) << i << " " << j;
      EXPECT_LE(std::abs(low), std::numeric_limits<double>::epsilon() * std::abs(high));
    }
  }
}

TEST(ToJointSpace, IsExactlySymmetric) {
  testing::Random random(22);
  TaskImpedance impedance = testing::random_impedance(random, 7, 6);
  impedance.stiffness = random.spd(7);
  const System<> system = to_joint_space(impedance);
  EXPECT_TRUE(system.symmetric());
  EXPECT_EQ(system.stiffness_low, system.stiffness_low.transpose());
  EXPECT_EQ(system.damping_low, system.damping_low.transpose());
}

TEST(ToJointSpace, AddsJointSpaceAndTaskSpaceParts) {
  testing::Random random(23);
  TaskImpedance both = testing::random_impedance(random, 5, 3);
  const System<> task_only = to_joint_space(both);
  both.stiffness = random.spd(5);
  both.damping = random.spd(5);
  const System<> system = to_joint_space(both);
  EXPECT_TRUE(near(system.stiffness, task_only.stiffness + *both.stiffness, 1e-11));
  EXPECT_TRUE(near(system.damping, task_only.damping + *both.damping, 1e-13));
}

TEST(ToJointSpace, OfAMassAloneHasNeitherDampingNorStiffness) {
  TaskImpedance impedance;
  impedance.mass = 2 * MatrixXd::Identity(2, 2);
  const System<> system = to_joint_space(impedance);
  EXPECT_TRUE(system.damping.isZero(0.0));
  EXPECT_TRUE(system.stiffness.isZero(0.0));
  EXPECT_FALSE(system.has_low_words);
}

TEST(ToJointSpace, OfJointSpaceMatricesTakesThemAsTheyAre) {
  TaskImpedance impedance;
  impedance.mass = testing::paper_chain().mass;
  impedance.damping = testing::paper_chain().damping;
  impedance.stiffness = testing::paper_chain().stiffness;
  const System<> system = to_joint_space(impedance);
  EXPECT_EQ(system.damping, *impedance.damping);
  EXPECT_EQ(system.stiffness, *impedance.stiffness);
  EXPECT_TRUE(system.damping_low.isZero(0.0));
  EXPECT_TRUE(system.stiffness_low.isZero(0.0));
}

TEST(ToJointSpace, AveragesRoundingInSymmetryAway) {
  TaskImpedance impedance;
  impedance.mass = 2 * MatrixXd::Identity(2, 2);
  impedance.stiffness = (MatrixXd(2, 2) << 1, 1e-11, 3e-11, 1).finished();
  EXPECT_DOUBLE_EQ(to_joint_space(impedance).stiffness(0, 1), 2e-11);
  EXPECT_TRUE(to_joint_space(impedance).symmetric());
}

// ------------------------------------------------------------------------------ the Eq. 55 extras

TEST(ToJointSpace, PaperEq55AddsDampingTimesTheRateOfTheJacobian) {
  testing::Random random(24);
  TaskImpedance impedance = testing::random_impedance(random, 4, 3);
  const System<> still = to_joint_space(impedance);
  impedance.jacobian_rate = random.matrix(3, 4);
  const System<> moving = to_joint_space(impedance);
  const MatrixXd expected =
      impedance.jacobian->transpose() * *impedance.task_damping * *impedance.jacobian_rate;
  EXPECT_TRUE(near(moving.stiffness - still.stiffness, expected, 1e-11));
  EXPECT_FALSE(moving.symmetric());
  EXPECT_EQ(moving.stiffness_factor.rows(), 0);
}

/// Planar arm with two links of length 1: the tip's position, its Jacobian's derivatives.
std::vector<MatrixXd> planar_derivatives(double q1, double q2) {
  const double s1 = std::sin(q1);
  const double c1 = std::cos(q1);
  const double s12 = std::sin(q1 + q2);
  const double c12 = std::cos(q1 + q2);
  return {(MatrixXd(2, 2) << -c1 - c12, -c12, -s1 - s12, -s12).finished(),
          (MatrixXd(2, 2) << -c12, -c12, -s12, -s12).finished()};
}

TEST(GeometricStiffness, PaperEq55OfAPlanarArmIsSymmetric) {
  const VectorXd f = VectorXd{{3, -7}};
  const MatrixXd K_G = geometric_stiffness(planar_derivatives(0.3, 0.8), f);
  const double first = -std::cos(0.3) * f(0) - std::sin(0.3) * f(1);
  const double second = -std::cos(1.1) * f(0) - std::sin(1.1) * f(1);
  EXPECT_TRUE(
      near(K_G, (MatrixXd(2, 2) << first + second, second, second, second).finished(), 1e-14));
}

TEST(GeometricStiffness, TakesOneColumnFromEachDerivative) {
  const std::vector<MatrixXd> derivatives = {(MatrixXd(1, 2) << 1, 2).finished(),
                                             (MatrixXd(1, 2) << 3, 4).finished()};
  EXPECT_TRUE(near(geometric_stiffness(derivatives, VectorXd::Constant(1, 10)),
                   (MatrixXd(2, 2) << 10, 30, 20, 40).finished(), 0));
}

TEST(ToJointSpace, PaperEq55AddsTheGeometricStiffness) {
  TaskImpedance impedance;
  impedance.mass = MatrixXd::Identity(2, 2);
  impedance.stiffness = 100 * MatrixXd::Identity(2, 2);
  impedance.wrench = VectorXd{{3, -7}};
  impedance.jacobian_derivatives = planar_derivatives(0.3, 0.8);
  impedance.jacobian_derivatives[0](0, 1) += 1e-15;  // rounding of another formula
  const System<> system = to_joint_space(impedance);
  EXPECT_TRUE(system.symmetric());
  EXPECT_EQ(system.stiffness_factor.rows(), 0);
  EXPECT_TRUE(near(system.stiffness - *impedance.stiffness,
                   geometric_stiffness(impedance.jacobian_derivatives, *impedance.wrench), 1e-13));

  impedance.jacobian_derivatives[0](0, 1) += 0.1;  // as of an angular row
  EXPECT_FALSE(to_joint_space(impedance).symmetric());
}

std::string refusal_of(const TaskImpedance& impedance) {
  try {
    to_joint_space(impedance);
    return "";
  } catch (const InvalidSystem& error) {
    return error.what();
  }
}

TEST(ToJointSpace, SaysWhatIsWrongWithAnImpedance) {
  using Change = void (*)(TaskImpedance&);
  struct Case {
    Change change;
    const char* refusal;
  };
  static const auto zero = [](int rows, int columns) -> MatrixXd {
    return MatrixXd::Zero(rows, columns);
  };
  // With a wrench and its derivatives, unless these are taken away.
  for (const Case& c : {
           Case{[](TaskImpedance&) {}, ""},
           // Missing members
           Case{[](TaskImpedance& i) { i.jacobian.reset(); }, "task_damping: needs a jacobian"},
           Case{[](TaskImpedance& i) { i.jacobian.reset(), i.task_damping.reset(); },
                "task_stiffness: needs a jacobian"},
           Case{[](TaskImpedance& i) { i.task_stiffness.reset(); }, ""},
           Case{[](TaskImpedance& i) {
                  i.task_stiffness.reset(), i.task_damping.reset(), i.wrench.reset();
                  i.jacobian_derivatives.clear();
                },
                "jacobian: needs task_damping or task_stiffness"},
           Case{[](TaskImpedance& i) { i.jacobian_rate = zero(2, 3), i.task_damping.reset(); },
                "jacobian_rate: needs task_damping"},
           Case{[](TaskImpedance& i) { i.jacobian_derivatives.clear(); },
                "wrench: needs jacobian_derivatives"},
           Case{[](TaskImpedance& i) { i.wrench.reset(); }, "jacobian_derivatives: needs a wrench"},
           // Wrong sizes
           Case{[](TaskImpedance& i) { i.mass = zero(3, 2); }, "mass: is 3 x 2, expected 3 x 3"},
           Case{[](TaskImpedance& i) { i.jacobian = zero(2, 4); },
                "jacobian: is 2 x 4, expected 2 x 3"},
           Case{[](TaskImpedance& i) { i.task_stiffness = zero(3, 3); },
                "task_stiffness: is 3 x 3, expected 2 x 2"},
           Case{[](TaskImpedance& i) { i.task_damping = zero(1, 1); },
                "task_damping: is 1 x 1, expected 2 x 2"},
           Case{[](TaskImpedance& i) { i.damping = zero(2, 2); },
                "damping: is 2 x 2, expected 3 x 3"},
           Case{[](TaskImpedance& i) { i.jacobian_rate = zero(1, 3); },
                "jacobian_rate: is 1 x 3, expected 2 x 3"},
           Case{[](TaskImpedance& i) { i.jacobian_derivatives.pop_back(); },
                "jacobian_derivatives: has 2 matrices, expected 3"},
           Case{[](TaskImpedance& i) { i.jacobian_derivatives[1] = zero(1, 3); },
                "jacobian_derivatives[2]: is 1 x 3, expected 2 x 3"},
           Case{[](TaskImpedance& i) { i.wrench = VectorXd::Zero(3); },
                "wrench: is 3 x 1, expected 2 x 1"},
           // Not finite, or not symmetric
           Case{[](TaskImpedance& i) { (*i.jacobian)(1, 2) = kNan; },
                "jacobian: entry (2,3) is not a finite number"},
           Case{[](TaskImpedance& i) { (*i.task_damping)(0, 0) = kNan; },
                "task_damping: entry (1,1) is not a finite number"},
           Case{[](TaskImpedance& i) {
                  i.jacobian_rate = zero(2, 3);
                  (*i.jacobian_rate)(0, 1) = kNan;
                },
                "jacobian_rate: entry (1,2) is not a finite number"},
           Case{[](TaskImpedance& i) { i.jacobian_derivatives[1](0, 1) = kNan; },
                "jacobian_derivatives[2]: entry (1,2) is not a finite number"},
           Case{[](TaskImpedance& i) { i.wrench = VectorXd::Constant(2, kNan); },
                "wrench: entry (1,1) is not a finite number"},
           Case{[](TaskImpedance& i) {
                  i.task_stiffness = (MatrixXd(2, 2) << 5, 3, 4, 5).finished();
                },
                "task_stiffness: is not symmetric: entry (1,2) is 3, entry (2,1) is 4"},
           Case{[](TaskImpedance& i) { i.mass *= -1; }, "mass: is not positive definite"},
       }) {
    SCOPED_TRACE(c.refusal);
    testing::Random random(28);
    TaskImpedance impedance = testing::random_impedance(random, 3, 2);
    impedance.wrench = random.vector(2);
    impedance.jacobian_derivatives.assign(3, random.matrix(2, 3));
    c.change(impedance);
    EXPECT_EQ(refusal_of(impedance), c.refusal);
  }
}

// -------------------------------------------------------------------------------------- the factor

void expect_factor(const System<>& system, Eigen::Index rows) {
  const MatrixXd& W = system.stiffness_factor;
  ASSERT_EQ(W.rows(), rows);
  EXPECT_TRUE(near(W.transpose() * W, system.stiffness, 1e-14 * W.squaredNorm()));
}

TEST(StiffnessFactor, OfADiagonalTaskStiffnessHasItsRoots) {
  const TaskImpedance arm = testing::paper_baxter();
  const System<> system = to_joint_space(arm);
  expect_factor(system, 5);
  EXPECT_TRUE(near(system.stiffness_factor.cwiseAbs().colwise().sum(),
                   (arm.task_stiffness->cwiseSqrt() * *arm.jacobian).cwiseAbs().colwise().sum(),
                   1e-14));
}

TEST(StiffnessFactor, OfFullMatricesIsStacked) {
  testing::Random random(25);
  TaskImpedance impedance = testing::random_impedance(random, 7, 6);
  expect_factor(to_joint_space(impedance), 6);
  impedance.stiffness = random.spd(7);
  expect_factor(to_joint_space(impedance), 13);
}

TEST(StiffnessFactor, OfASingularTaskStiffnessHasExactZeros) {
  testing::Random random(26);
  for (int i = 0; i < 50; ++i) {
    TaskImpedance impedance = testing::random_impedance(random, 5, 4);
    const MatrixXd root = random.matrix(4, 2);
    const MatrixXd product = 1e4 * root * root.transpose();
    impedance.task_stiffness = 0.5 * (product + product.transpose());
    const System<> system = to_joint_space(impedance);
    expect_factor(system, 4);
    EXPECT_EQ((system.stiffness_factor.rowwise().norm().array() > 0).count(), 2);
  }
}

TEST(StiffnessFactor, KeepsSmallStiffnessesBesideLargeOnes) {
  TaskImpedance impedance;
  impedance.mass = MatrixXd::Identity(3, 3);
  impedance.stiffness =
      (MatrixXd(3, 3) << 1e12, 1e3, 0, 1e3, 1e-4, 5e-11, 0, 5e-11, 1e-15).finished();
  const System<> system = to_joint_space(impedance);
  const MatrixXd product = system.stiffness_factor.transpose() * system.stiffness_factor;
  const VectorXd scale = system.stiffness.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_TRUE(near(scale.asDiagonal() * product * scale.asDiagonal(),
                   scale.asDiagonal() * system.stiffness * scale.asDiagonal(), 1e-14));
}

TEST(StiffnessFactor, OfAnIndefiniteStiffnessIsLeftOut) {
  testing::Random random(27);
  TaskImpedance impedance = testing::random_impedance(random, 4, 2);
  for (const MatrixXd& indefinite :
       {(MatrixXd(2, 2) << 1, 2, 2, 1).finished(), (MatrixXd(2, 2) << 0, 1, 1, 5).finished(),
        (MatrixXd(2, 2) << 1, 0, 0, -1e-9).finished()}) {
    impedance.task_stiffness = indefinite;
    impedance.stiffness.reset();
    EXPECT_EQ(to_joint_space(impedance).stiffness_factor.rows(), 0);
    impedance.stiffness = random.spd(4);
    EXPECT_EQ(to_joint_space(impedance).stiffness_factor.rows(), 0);
  }
}

}  // namespace
}  // namespace dashpot::analysis
