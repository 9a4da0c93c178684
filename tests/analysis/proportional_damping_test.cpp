// Paths on which the undamped modes decouple the damping.
#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/tests/support/panda_path.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/tracked.hpp>
#include <dashpot/tests/support/true_spectrum.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <memory>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::expect_enclosed;
using testing::panda_impedance;
using testing::Random;
using testing::swing;
using testing::Tracked;

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

TEST_P(ProportionalPath, IsFollowed) {
  const auto [zeta, full] = GetParam();
  Tracked tracked;
  for (int step = 0; step < 200; ++step) {
    const System<kMaxDof> system = arm(1e-3 * step, zeta, full);
    ASSERT_EQ(tracked.update(system), Status::kOk);
    if (step % 20 != 0) continue;
    SCOPED_TRACE("step " + std::to_string(step));
    expect_enclosed(system, *tracked.spectrum);
    System<kMaxDof> with_stiffness = system;
    if (!full) {
      with_stiffness.stiffness = system.stiffness_factor.transpose() * system.stiffness_factor;
    }
    for (int i = 0; i < tracked.spectrum->mode_count; ++i) {
      EXPECT_NEAR(tracked.mode(i).damping_ratio, zeta, 1e-9);
      const TrackedShapes& shapes = tracked.spectrum->shapes[static_cast<std::size_t>(i)];
      for (std::size_t k = 0; k < 2; ++k) {
        EXPECT_LE(
            testing::backward_error(with_stiffness, tracked.mode(i).eigenvalues[k], shapes.u[k]),
            1e-13);
      }
    }
  }
  EXPECT_EQ(tracked.counters().tracked, 199);
  EXPECT_LE(tracked.counters().iterations, full ? 400 : 230);
}

INSTANTIATE_TEST_SUITE_P(Ratios, ProportionalPath,
                         ::testing::Combine(::testing::Values(0.0, 0.1, 0.7, 3.0),
                                            ::testing::Bool()));

TEST(ProportionalDamping, LetsModesCross) {
  Tracked tracked;
  Random random(5300);
  const MatrixXd Q = Eigen::HouseholderQR<MatrixXd>(random.matrix(5, 5)).householderQ();
  for (int step = 0; step <= 1000; ++step) {
    const double t = 2e-3 * step;
    VectorXd kappa{{100, 400 - 140 * t, 200, 900, 300 + 100 * t}};
    const MatrixXd K = Q * kappa.asDiagonal() * Q.transpose();
    System<kMaxDof> system(5);
    system.mass.setIdentity();
    system.stiffness = 0.5 * (K + K.transpose());
    const MatrixXd C = Q * (0.4 * kappa.cwiseSqrt()).asDiagonal() * Q.transpose();
    system.damping = 0.5 * (C + C.transpose());
    ASSERT_EQ(tracked.update(system), Status::kOk) << "step " << step;
    if (step % 50 == 0) expect_enclosed(system, *tracked.spectrum);
  }
  EXPECT_EQ(tracked.spectrum->epoch, 1U);
  EXPECT_GE(tracked.counters().tracked, 990);
}

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
      Tracked tracked;
      for (int step = 0; step < 4; ++step) {
        system.mass = M + step * dM;
        system.stiffness_factor = W + step * dW;
        damp(system, 0.4);
        ASSERT_EQ(tracked.update(system), Status::kOk);
        expect_enclosed(system, *tracked.spectrum);
      }
      EXPECT_EQ(tracked.counters().tracked, 3);
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
