// RigidBodyElimination of zero modes: the paper's printed matrices, and the invariants of any
// elimination.
#include <dashpot/analysis/rigid_body_elimination.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/paper_examples.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::as_printed;
using testing::near;

/// `first` vectors projected to the null space of the stiffness and made M-orthonormal in turn.
ZeroModes<> zero_modes_from(const System<>& system, const MatrixXd& first) {
  const Eigen::JacobiSVD<MatrixXd> svd(system.stiffness, Eigen::ComputeFullV);
  const MatrixXd null_space = svd.matrixV().rightCols(first.cols());
  ZeroModes<> zero_modes;
  zero_modes.count = static_cast<int>(first.cols());
  zero_modes.basis = null_space * (null_space.transpose() * first);
  for (int k = 0; k < zero_modes.count; ++k) {
    auto u = zero_modes.basis.col(k);
    for (int j = 0; j < k; ++j) {
      const VectorXd earlier = zero_modes.basis.col(j);
      u -= earlier * earlier.dot(system.mass * u);
    }
    u /= std::sqrt(u.dot(system.mass * u));
  }
  return zero_modes;
}

ZeroModes<> chain_zero_modes() {
  return zero_modes_from(testing::paper_chain(), MatrixXd::Ones(3, 1));
}

TEST(RigidBodyElimination, PaperEqs40And42MatricesOfTheChain) {
  const RigidBodyElimination elimination =
      eliminate_zero_modes(testing::paper_chain(), chain_zero_modes(), Pivot::kLast);
  EXPECT_EQ(elimination.eliminated, std::vector<int>{2});
  const auto expect = [](const MatrixXd& found, const MatrixXd& printed, double tolerance) {
    EXPECT_TRUE(near(found, printed, tolerance));
  };
  expect(elimination.constraint_matrix, MatrixXd{{1, 0}, {0, 1}, {-1.6, -0.4}}, 1e-14);
  expect(elimination.mass, MatrixXd{{20.8, 3.2}, {3.2, 2.8}}, 1e-13);
  expect(elimination.damping, MatrixXd{{133.8, 40.2}, {40.2, 55.8}}, 1e-12);
  expect(elimination.stiffness, MatrixXd{{21264, 4656}, {4656, 4524}}, 1e-10);
}

/// The arm without the vectors printed as U_r, of which S0 depends on the first.
class PaperArmReduced : public ::testing::Test {
 protected:
  PaperArmReduced() {
    MatrixXd printed(7, 2);
    printed << 0.1988, -0.06389, 0, 0, -0.4589, 0.3744, 0, 0, 0.3825, -0.6587, 0, 0, 0.1478, 2.952;
    elimination = eliminate_zero_modes(system, zero_modes_from(system, printed), Pivot::kLast);
    S0 = elimination.steps.at(0);
  }
  System<> system = to_joint_space(testing::paper_baxter());
  RigidBodyElimination elimination;
  MatrixXd S0;
};

TEST_F(PaperArmReduced, Eqs60To63ConstraintMatrices) {
  ASSERT_EQ(elimination.steps.size(), 2u);
  const MatrixXd &S1 = elimination.steps[1], &S = elimination.constraint_matrix;
  EXPECT_TRUE(near(S0.topRows(6), MatrixXd::Identity(6, 6), 0));
  EXPECT_TRUE(
      as_printed(S0.bottomRows(1), {{"-17.04", "3.118", "11.45", "1.86", "-6.304", "1.94"}}));
  for (const MatrixXd* one : {&S1, &S}) {
    EXPECT_TRUE(near(one->topRows(5), MatrixXd::Identity(5, 5), 0));
  }
  EXPECT_TRUE(as_printed(S1.bottomRows(1), {{"22.4", "-1.93", "-14.1", "-0.813", "9.48"}}));
  EXPECT_TRUE(as_printed(S.bottomRows(2), {{"22.36", "-1.925", "-14.08", "-0.8126", "9.478"},
                                           {"26.43", "-0.6264", "-15.93", "0.2800", "12.12"}}));
}

TEST_F(PaperArmReduced, Appendix3MatricesOfTheSecondReducedSpace) {
  EXPECT_TRUE(as_printed(elimination.mass, {{"1200", "-35.30", "-746.4", "9.815", "516.2"},
                                            {"-35.30", "5.813", "22.01", "2.106", "-14.85"},
                                            {"-746.4", "22.01", "469.6", "-6.214", "-318.4"},
                                            {"9.815", "2.106", "-6.214", "2.485", "4.357"},
                                            {"516.2", "-14.85", "-318.4", "4.357", "224.08"}}));
  EXPECT_TRUE(as_printed(elimination.damping, {{"782.6", "-32.31", "-494.04", "8.318", "323.7"},
                                               {"-32.31", "2.612", "20.55", "0.2951", "-13.29"},
                                               {"-494.04", "20.55", "316.4", "-5.216", "-203.2"},
                                               {"8.318", "0.2951", "-5.216", "0.4382", "3.467"},
                                               {"323.7", "-13.29", "-203.2", "3.467", "135.6"}}));
  EXPECT_TRUE(
      as_printed(elimination.stiffness, {{"11240.5", "-472.08", "-6609.2", "222.44", "4703"},
                                         {"-472.08", "71.17", "284.5", "15.82", "-197.7"},
                                         {"-6609.2", "284.5", "4148.1", "-133.4", "-2783.8"},
                                         {"222.44", "15.82", "-133.4", "17.98", "93.54"},
                                         {"4703", "-197.7", "-2783.8", "93.54", "1980.5"}}));
}

TEST_F(PaperArmReduced, EigenvaluesOfTheReducedStiffnesses) {
  const auto eigenvalues = [](const MatrixXd& K) -> MatrixXd {
    return Eigen::SelfAdjointEigenSolver<MatrixXd>(K).eigenvalues().reverse().transpose();
  };
  EXPECT_TRUE(as_printed(eigenvalues(S0.transpose() * system.stiffness * S0),
                         {{"252.55", "120.22", "67.58", "16.587", "0.5843", "0.0000"}}));
  EXPECT_TRUE(as_printed(eigenvalues(elimination.stiffness),
                         {{"17186", "197.01", "63.79", "10.023", "0.8841"}}));
}

// ------------------------------------------------------------------------ any system, any pivot

System<> random_system(testing::Random& random, int n, int r) {
  const MatrixXd W = random.matrix(n - r, n);
  return testing::system_from(random.spd(n), random.spd(n),
                              testing::symmetrized(100 * W.transpose() * W));
}

TEST(RigidBodyElimination, LeavesTheNonzeroFrequenciesAndMotionsOrthogonalToEveryZeroMode) {
  testing::Random random(12);
  for (int i = 0; i < 50; ++i) {
    const int n = random.integer(2, 7), r = random.integer(1, std::min(3, n - 1));
    const System<> system = random_system(random, n, r);
    const ZeroModes<> zero_modes = zero_modes_from(system, random.matrix(n, r));
    const RigidBodyElimination elimination =
        eliminate_zero_modes(system, zero_modes, Pivot::kLargest);
    const auto frequencies = [](const MatrixXd& K, const MatrixXd& M) -> VectorXd {
      return Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd>(K, M).eigenvalues();
    };
    const VectorXd all = frequencies(system.stiffness, system.mass);
    EXPECT_TRUE(near(frequencies(elimination.stiffness, elimination.mass), all.tail(n - r),
                     1e-10 * all(n - 1)));
    const MatrixXd& S = elimination.constraint_matrix;
    EXPECT_TRUE(near(zero_modes.basis.transpose() * system.mass * S, MatrixXd::Zero(r, n - r),
                     1e-13 * S.norm()));
    MatrixXd product = MatrixXd::Identity(n, n);
    for (const MatrixXd& step : elimination.steps) product *= step;
    EXPECT_TRUE(near(S, product, 1e-14 * S.norm()));
  }
  const System<> whole = random_system(random, 4, 0);
  const RigidBodyElimination none =
      eliminate_zero_modes(whole, zero_modes_from(whole, MatrixXd(4, 0)), Pivot::kLargest);
  EXPECT_TRUE(near(none.constraint_matrix, MatrixXd::Identity(4, 4), 0));
  EXPECT_TRUE(near(none.stiffness, whole.stiffness, 0));
  EXPECT_TRUE(none.steps.empty());
}

TEST(RigidBodyElimination, LeavesTheModesOfAMovingRedundantArm) {
  testing::Random random(47);
  for (int i = 0; i < 50; ++i) {
    TaskImpedance impedance;
    const int n = random.integer(2, 8), m = random.integer(1, n - 1);
    impedance.mass = random.spd(n);
    impedance.jacobian = random.matrix(m, n);
    impedance.task_stiffness = 100 * random.spd(m);
    impedance.task_damping = random.spd(m);
    impedance.jacobian_rate = random.matrix(m, n);
    const System<> system = to_joint_space(impedance);
    ASSERT_FALSE(system.symmetric());
    const Spectrum<> spectrum = analyze(system);
    ASSERT_EQ(spectrum.zero_modes.count, n - m);
    const RigidBodyElimination elimination = eliminate_zero_modes(system, spectrum.zero_modes);
    System<> reduced(m);
    reduced.mass = elimination.mass;
    reduced.damping = elimination.damping;
    reduced.stiffness = elimination.stiffness;
    const Spectrum<> same = analyze(reduced);
    ASSERT_EQ(spectrum.modes.size(), m);
    for (int k = 0; k < m; ++k) {
      const Mode<>&one = spectrum.modes[k], &other = same.modes[k];
      EXPECT_NEAR(one.natural_frequency, other.natural_frequency, 1e-8 * one.natural_frequency);
      EXPECT_NEAR(one.damping_ratio, other.damping_ratio, 1e-8);
    }
  }
}

TEST(RigidBodyElimination, DependsOnTheZeroModesTogetherOnly) {
  testing::Random random(14);
  const System<> system = random_system(random, 6, 3);
  const MatrixXd some = random.matrix(6, 3);
  const auto eliminated = [&](const MatrixXd& vectors) {
    return eliminate_zero_modes(system, zero_modes_from(system, vectors), Pivot::kLast);
  };
  const RigidBodyElimination one = eliminated(some), other = eliminated(some * random.matrix(3, 3));
  EXPECT_TRUE(near(one.constraint_matrix, other.constraint_matrix, 1e-11));
  EXPECT_FALSE(near(one.steps[0], other.steps[0], 1e-3));
}

TEST(RigidBodyElimination, EliminatesTheCoordinateThatMovesMostAndRefusesOneThatDoesNot) {
  System<> chain = testing::paper_chain();
  const auto eliminated = [](const System<>& system, const MatrixXd& vectors) {
    return eliminate_zero_modes(system, zero_modes_from(system, vectors), Pivot::kLargest)
        .eliminated;
  };
  EXPECT_EQ(eliminated(chain, MatrixXd::Ones(3, 1)), std::vector<int>{0});
  chain.mass.diagonal() << 2, 8, 5;
  EXPECT_EQ(eliminated(chain, MatrixXd::Ones(3, 1)), std::vector<int>{1});
  const MatrixXd all = MatrixXd::Identity(3, 3).rowwise().reverse();
  EXPECT_EQ(eliminated(System<>(3), all), (std::vector<int>{2, 1, 0}));
  EXPECT_EQ(eliminate_zero_modes(System<>(3), zero_modes_from(System<>(3), all), Pivot::kLargest)
                .mass.size(),
            0);
  System<> system(2);
  system.stiffness(1, 1) = 1;
  const MatrixXd first = MatrixXd::Identity(2, 1);
  EXPECT_THROW(eliminate_zero_modes(system, zero_modes_from(system, first), Pivot::kLast),
               std::domain_error);
  EXPECT_EQ(eliminated(system, first), std::vector<int>{0});
  EXPECT_THROW(eliminate_zero_modes(System<>(2), chain_zero_modes(), Pivot::kLast),
               std::invalid_argument);
}

/// Masses 1, 2, 4 with two springs, one of them much stiffer, whose zero mode is (1, 1, 1).
TEST(RigidBodyElimination, OfUnlikeSpringsIsExact) {
  const Eigen::Vector3d soft(1, 1, -2), stiff(1, -2, 1);
  for (int grade = 0; grade <= 40; grade += 2) {
    const double k = std::ldexp(1.0, grade);
    TaskImpedance chain;
    chain.mass = Eigen::Vector3d(1, 2, 4).asDiagonal();
    chain.stiffness = soft * soft.transpose() + k * stiff * stiff.transpose();
    const System<> system = to_joint_space(chain);
    const Spectrum<> spectrum = analyze(system);
    ASSERT_EQ(spectrum.zero_modes.count, 1) << grade;
    const VectorXd u = spectrum.zero_modes.basis.cwiseAbs() * std::sqrt(7.0);
    EXPECT_TRUE(near(u, VectorXd::Ones(3), 2e-15)) << "2^" << grade;
    const RigidBodyElimination elimination =
        eliminate_zero_modes(system, spectrum.zero_modes, Pivot::kLast);
    const MatrixXd S = (MatrixXd(3, 2) << 1, 0, 0, 1, -0.25, -0.5).finished();
    EXPECT_TRUE(near(elimination.constraint_matrix, S, 2e-15)) << "2^" << grade;
    const MatrixXd reduced = S.transpose() * *chain.stiffness * S;
    EXPECT_TRUE(near(elimination.stiffness, reduced, 2e-14 * k)) << "2^" << grade;
  }
}

}  // namespace
}  // namespace dashpot::analysis
