// Which motions store no potential energy, and how safe that decision is.
#include <dashpot/analysis/system/zero_modes.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/tests/support/matrices.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::near;
using testing::Random;
using testing::symmetrized;

ZeroModes<> zero_modes_of(const System<>& system) {
  const MatrixXd L = Eigen::LLT<MatrixXd>(system.mass).matrixL();
  return find_zero_modes<kDynamic>(system, L);
}

/// K = W'W with W of `rank` rows.
System<> redundant(Random& random, int n, int rank, bool with_factor) {
  System<> system(n);
  system.mass = random.spd(n);
  const MatrixXd W = random.matrix(rank, n);
  system.stiffness = symmetrized(W.transpose() * W);
  if (with_factor) system.stiffness_factor = W;
  return system;
}

void expect_proper(const System<>& system, const ZeroModes<>& found) {
  const Eigen::Index n = system.dof(), r = found.count;
  const MatrixXd& T = found.coordinates;
  EXPECT_TRUE(near(T.transpose() * system.mass * T, MatrixXd::Identity(n, n), 1e-13));
  EXPECT_TRUE(near(found.basis, T.rightCols(r), 0));
  EXPECT_TRUE(near(system.stiffness * found.basis, MatrixXd::Zero(n, r),
                   1e-13 * system.stiffness.norm() * found.basis.norm()));
  const VectorXd& kappa = found.stiffness_values;
  EXPECT_TRUE(near(T.transpose() * system.stiffness * T, MatrixXd(kappa.asDiagonal()),
                   1e-13 * std::abs(kappa[0])));
  for (Eigen::Index i = 1; i < n; ++i) EXPECT_LE(std::abs(kappa[i]), std::abs(kappa[i - 1]));
  EXPECT_TRUE(near(kappa.tail(r), VectorXd::Zero(r), 0));
}

TEST(ZeroModes, AreAsManyAsTheStiffnessLacksInRankAndSayHowClearThatIs) {
  Random random(401);
  for (int trial = 0; trial < 60; ++trial) {
    const int n = random.integer(1, 12), rank = random.integer(0, n);
    const System<> system = redundant(random, n, rank, trial % 2 == 0);
    const ZeroModes<> found = zero_modes_of(system);
    ASSERT_EQ(found.count, n - rank);
    expect_proper(system, found);
    EXPECT_EQ(found.basis.cols(), n - rank);
    const VectorXd kappa =
        Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd>(system.stiffness, system.mass)
            .eigenvalues();
    if (rank == 0) {
      EXPECT_EQ(found.smallest_kept, testing::kInfinity);
    } else {  // a full K knows the square of it
      EXPECT_NEAR(found.smallest_kept * found.smallest_kept, kappa[n - rank], 1e-12 * kappa[n - 1]);
      EXPECT_LT(found.floor, found.smallest_kept);
    }
    EXPECT_LE(found.largest_dropped, found.floor);
    if (rank == 0 || rank == n) EXPECT_EQ(found.largest_dropped, 0);
  }
}

TEST(ZeroModes, KeepSoftMotionsThatOnlyTheFactorShows) {
  // Frequencies 1 and 1e-10: their squares are 1e-20 apart, below rounding in a full K.
  Random random(404);
  const MatrixXd Q = random.matrix(4, 4).householderQr().householderQ();
  System<> system(4);
  system.stiffness_factor = VectorXd{{1, 1e-3, 1e-10, 0}}.asDiagonal() * Q;
  system.stiffness = symmetrized(system.stiffness_factor.transpose() * system.stiffness_factor);
  const ZeroModes<> found = zero_modes_of(system);
  EXPECT_EQ(found.count, 1);
  EXPECT_NEAR(found.smallest_kept, 1e-10, 1e-15);
  EXPECT_NEAR(found.stiffness_values[1], 1e-6, 1e-17);
}

TEST(ZeroModes, SeeThroughGradedMassesAndStiffnesses) {
  // A chain of springs between masses and stiffnesses over twelve decades: free, then held.
  for (const bool held : {false, true}) {
    const int n = 5;
    System<> system(n);
    for (int i = 0; i < n; ++i) system.mass(i, i) = std::ldexp(1.0, 8 * i);
    for (int i = 0; i + 1 < n; ++i) {
      const double k = std::ldexp(1.0, 10 * i);
      system.stiffness(i, i) += k;
      system.stiffness(i + 1, i + 1) += k;
      system.stiffness(i, i + 1) -= k;
      system.stiffness(i + 1, i) -= k;
    }
    if (held) system.stiffness(0, 0) += 1;
    const ZeroModes<> found = zero_modes_of(system);
    EXPECT_EQ(found.count, held ? 0 : 1);
    if (held) continue;
    const VectorXd u = found.basis / found.basis(0, 0);
    EXPECT_TRUE(near(u, VectorXd::Ones(n), 1e-12));
  }
}

TEST(ZeroModes, OfAStiffnessThatIsGivenAreAsExactAlongSoftMotionsAsAlongStiffOnes) {
  // K = W'W exactly, of integers and powers of two: rows of W over six decades, masses over three.
  // The factor that to_joint_space makes of it is rounded.
  const int n = 12, rank = 9;
  for (const std::uint64_t seed : {407u, 408u, 409u, 410u}) {
    Random random(seed);
    MatrixXd W(rank, n), G(n, n);
    for (int i = 0; i < rank; ++i) {
      for (int j = 0; j < n; ++j) W(i, j) = (i == j ? 3 : 0) + random.integer(-1, 1);
    }
    for (double& g : G.reshaped()) g = random.integer(-1, 1);
    VectorXd S(n), stiff(rank);
    for (double& s : S) s = std::ldexp(1.0, random.integer(0, 5));
    for (int i = 0; i < rank; ++i) stiff[i] = std::ldexp(1.0, (20 * i) / (rank - 1));
    W = stiff.asDiagonal() * W * S.asDiagonal();
    System<> system(n);
    system.mass =
        S.asDiagonal() * (G.transpose() * G + n * MatrixXd::Identity(n, n)) * S.asDiagonal();
    system.stiffness = W.transpose() * W;
    ASSERT_EQ(W.cast<long double>().transpose() * W.cast<long double>(),
              system.stiffness.cast<long double>());
    TaskImpedance joints, task;
    joints.mass = task.mass = system.mass;
    joints.stiffness = task.task_stiffness = system.stiffness;
    task.jacobian = MatrixXd::Identity(n, n);
    for (const System<>& given : {system, to_joint_space(joints), to_joint_space(task)}) {
      const ZeroModes<> found = zero_modes_of(given);
      ASSERT_EQ(found.count, n - rank);
      for (int i = 0; i < rank; ++i) {
        const double size = W.row(i).cwiseAbs().dot(found.basis.cwiseAbs().rowwise().maxCoeff());
        EXPECT_LE((W.row(i) * found.basis).norm(), 1e-12 * size) << "row " << i + 1 << " of W";
      }
    }
  }
}

TEST(ZeroModes, OfAnExactFactorAreNotThoseOfTheRoundedStiffness) {
  // W W' is graded over 2^20, and W'W does not fit into doubles.
  Random random(411);
  const MatrixXd W = VectorXd{{1, 0x1p-20}}.asDiagonal() * random.matrix(2, 3);
  System<> system(3);
  system.stiffness_factor = W;
  system.stiffness = symmetrized(W.transpose() * W);
  const ZeroModes<> found = zero_modes_of(system);
  ASSERT_EQ(found.count, 1);
  EXPECT_LE(std::abs(W.row(1).dot(found.basis.col(0))), 1e-8 * W.row(1).norm());
}

TEST(ZeroModes, KeepNegativeStiffness) {
  System<> system(3);
  system.stiffness.diagonal() << 4, -9, 0;
  const ZeroModes<> found = zero_modes_of(system);
  EXPECT_EQ(found.count, 1);
  EXPECT_TRUE(near(found.stiffness_values, Eigen::Vector3d(-9, 4, 0), 1e-14));
  // A zero on the diagonal beside what is not: indefinite, with no zero mode at all.
  System<> pair(2);
  pair.stiffness << 0, 3, 3, 0;
  const ZeroModes<> none = zero_modes_of(pair);
  EXPECT_EQ(none.count, 0);
  EXPECT_NEAR(none.stiffness_values.minCoeff(), -3, 1e-14);
  EXPECT_NEAR(none.stiffness_values.maxCoeff(), 3, 1e-14);
}

TEST(ZeroModes, OfANonsymmetricStiffnessSpanItsNullSpace) {
  Random random(405);
  const MatrixXd J = random.matrix(3, 5);
  System<> system(5);
  system.mass = random.spd(5);
  system.stiffness = J.transpose() * random.matrix(3, 3) * J;
  const ZeroModes<> found = zero_modes_of(system);
  ASSERT_EQ(found.count, 2);
  EXPECT_TRUE(near(system.stiffness * found.basis, MatrixXd::Zero(5, 2),
                   1e-13 * system.stiffness.norm() * found.basis.norm()));
  EXPECT_TRUE(
      near(found.basis.transpose() * system.mass * found.basis, MatrixXd::Identity(2, 2), 1e-13));
}

}  // namespace
}  // namespace dashpot::analysis
