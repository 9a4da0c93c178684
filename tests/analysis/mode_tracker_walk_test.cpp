// Random walks through the systems of 1 to 16 coordinates: every bound encloses the truth.
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <array>
#include <vector>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::panda_impedance;
using testing::Random;
using testing::swing;

struct Size {
  int joints, rows;
};
void PrintTo(const Size& size, std::ostream* out) {
  *out << size.joints << " joints, " << size.rows << " rows";
}

class RandomWalk : public ::testing::TestWithParam<Size> {};
INSTANTIATE_TEST_SUITE_P(Sizes, RandomWalk,
                         ::testing::ValuesIn(std::vector<Size>{
                             {1, 1},   {1, 0},  {2, 2},   {2, 1},  {3, 0},  {3, 2},  {4, 3},
                             {5, 5},   {5, 0},  {6, 6},   {7, 6},  {7, 5},  {7, 0},  {7, 3},
                             {8, 6},   {9, 6},  {10, 10}, {11, 0}, {12, 6}, {13, 6}, {14, 3},
                             {15, 12}, {16, 6}, {16, 0},  {16, 16}}),
                         [](const auto& size) {
                           return "Joints" + std::to_string(size.param.joints) + "Rows" +
                                  std::to_string(size.param.rows);
                         });

TEST_P(RandomWalk, IsFollowedWithinItsBounds) {
  const auto [n, rows] = GetParam();
  testing::Dice dice(2000 + 100U * static_cast<unsigned>(n) + static_cast<unsigned>(rows));
  testing::Follower follower;
  const int steps = n <= 7 ? 500 : 200, apart = n <= 7 ? 10 : 25;
  for (int walk = 0; walk < 3; ++walk) {
    follower.follow(testing::wandering_of(n, rows, dice), steps, 1e-3 * steps, apart);
    ASSERT_EQ(follower.spectrum->mode_count, rows > 0 ? rows : n);
  }
  // Followed, not solved directly; and the bounds are worth something.
  EXPECT_GE(follower.counters().tracked, 0.97 * 3 * steps);
  EXPECT_LE(follower.widest, 1e-3);
}

// Arms with several zero modes, as a stiffness of translations alone leaves them: their rates often
// coincide, and must not keep the modes from being followed.

enum class Friction {
  kNone,      ///< of the zero modes: all rates are zero
  kEqual,     ///< one rate for all
  kSmall,     ///< of each joint, a millionth of the springs' damping
  kOrdinary,  ///< of each joint
};
void PrintTo(Friction friction, std::ostream* out) {
  *out << std::array{"none", "equal", "small", "ordinary"}[static_cast<std::size_t>(friction)];
}

class SeveralZeroModes : public ::testing::TestWithParam<std::tuple<int, Friction>> {};

TEST_P(SeveralZeroModes, AreFollowed) {
  const auto [p, friction] = GetParam();
  const int n = 9;
  Random random(5400U + static_cast<unsigned>(p));
  const MatrixXd M = MatrixXd::Identity(n, n) + 0.1 / n * random.spd(n);
  MatrixXd W = 0.3 * random.matrix(p, n);
  for (int i = 0; i < p; ++i) W(i, i) += 10 + 2 * i;
  const MatrixXd dM = 1e-6 * random.spd(n), dW = 1e-3 * random.matrix(p, n);
  const VectorXd joints = VectorXd::NullaryExpr(n, [&] { return random.uniform(0.5, 2); });
  const auto at = [&, kind = friction](double step) {
    System<kMaxDof> system(n);
    system.mass = M + step * dM;
    const MatrixXd factor = W + step * dW;
    system.stiffness_factor = factor;
    MatrixXd C = 0.03 * factor.transpose() * factor;
    if (kind == Friction::kEqual) C += 0.5 * system.mass;
    if (kind == Friction::kSmall) C += 1e-6 * MatrixXd(joints.asDiagonal());
    if (kind == Friction::kOrdinary) C += MatrixXd(joints.asDiagonal());
    system.damping = 0.5 * (C + C.transpose());
    return system;
  };
  testing::Follower follower;
  follower.follow(at, 250, 249, 50);
  follower.expect_followed();
  EXPECT_LE(follower.counters().iterations, 650);
  ASSERT_EQ(follower.spectrum->zero_mode_count, n - p);
  const auto truth = testing::true_eigenvalues(at(249));
  for (int k = 0; k < n - p; ++k) {
    const Complex rate = follower.spectrum->zero_mode_rates[static_cast<std::size_t>(k)];
    EXPECT_LE(testing::distance_to_nearest(rate, truth), 1e-11);
  }
}

INSTANTIATE_TEST_SUITE_P(Arms, SeveralZeroModes,
                         ::testing::Combine(::testing::Values(1, 2, 3, 6),
                                            ::testing::Values(Friction::kNone, Friction::kEqual,
                                                              Friction::kSmall,
                                                              Friction::kOrdinary)));

// Paths on which the undamped modes decouple the damping.

/// C = M Phi diag(2 zeta omega) Phi' M with the undamped modes Phi, and none for zero modes.
void damp(System<kMaxDof>& system, double zeta) {
  const MatrixXd M = system.mass;
  const MatrixXd W = system.stiffness_factor;
  const MatrixXd K = W.rows() > 0 ? MatrixXd(W.transpose() * W) : MatrixXd(system.stiffness);
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> modes(K, M);
  VectorXd rates = VectorXd::Zero(M.rows());
  const Eigen::Index zeros = W.rows() > 0 ? M.rows() - W.rows() : 0;
  for (Eigen::Index k = zeros; k < M.rows(); ++k) {
    rates[k] = 2 * zeta * std::sqrt(modes.eigenvalues()[k]);
  }
  const MatrixXd MPhi = M * modes.eigenvectors();
  const MatrixXd C = MPhi * rates.asDiagonal() * MPhi.transpose();
  system.damping = 0.5 * (C + C.transpose());
}

/// Without a factor, if `full`: three joints more than modes become springs of their own.
System<kMaxDof> arm(double t, double zeta, bool full) {
  System<kMaxDof> system = panda_impedance(swing(t), 0);
  if (full) {
    const MatrixXd W = system.stiffness_factor;
    const MatrixXd K = W.transpose() * W + 30 * MatrixXd::Identity(7, 7);
    system.stiffness = 0.5 * (K + K.transpose());
    system.stiffness_factor.resize(0, 7);
  }
  damp(system, zeta);
  return system;
}

class ProportionalPath : public ::testing::TestWithParam<std::tuple<double, bool>> {};

struct ProportionalFollower : testing::Follower {
  explicit ProportionalFollower(double ratio) : zeta(ratio) {}
  void look(const System<kMaxDof>& system) override {
    System<kMaxDof> whole = system;
    const auto& W = system.stiffness_factor;
    if (W.rows() > 0) whole.stiffness = W.transpose() * W;
    for (int i = 0; i < spectrum->mode_count; ++i) {
      EXPECT_NEAR(mode(i).damping_ratio, zeta, 1e-9);
      const TrackedShapes& shapes = spectrum->shapes[static_cast<std::size_t>(i)];
      for (std::size_t k = 0; k < 2; ++k) {
        EXPECT_LE(testing::backward_error(whole, mode(i).eigenvalues[k], shapes.u[k]), 1e-13);
      }
    }
  }
  double zeta;
};

TEST_P(ProportionalPath, IsFollowed) {
  const auto [zeta, full] = GetParam();
  ProportionalFollower follower(zeta);
  follower.follow([z = zeta, whole = full](double t) { return arm(t, z, whole); }, 200, 0.199, 20);
  follower.expect_followed();
  EXPECT_LE(follower.counters().iterations, full ? 400 : 230);
}

INSTANTIATE_TEST_SUITE_P(Ratios, ProportionalPath,
                         ::testing::Combine(::testing::Values(0.0, 0.1, 0.7, 3.0),
                                            ::testing::Bool()));

TEST(ProportionalDamping, IsFollowedForAnyNumberOfJointsAndModes) {
  Random random(5301);
  for (int n = 1; n <= kMaxDof; ++n) {
    for (int p = 1; p <= n; ++p) {
      SCOPED_TRACE(std::to_string(n) + " joints, " + std::to_string(p) + " modes");
      System<kMaxDof> system(n);
      const MatrixXd M = MatrixXd::Identity(n, n) + 0.1 / n * random.spd(n);
      MatrixXd W = 0.3 * random.matrix(p, n);
      for (int i = 0; i < p; ++i) W(i, i) += 10 + i;
      const MatrixXd dM = 1e-5 * random.spd(n), dW = 1e-3 * random.matrix(p, n);
      testing::Follower follower;
      follower.follow(
          [&](double step) {
            system.mass = M + step * dM;
            system.stiffness_factor = W + step * dW;
            damp(system, 0.4);
            return system;
          },
          4, 3);
      follower.expect_followed();
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
