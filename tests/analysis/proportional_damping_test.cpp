// Paths on which the undamped modes decouple the damping.
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::panda_impedance;
using testing::Random;
using testing::swing;

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
