// The Fourier transform of a simulated release has its peaks at the modes, as high as their shares
// predict: so dominant modes are found from measured motion.
#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/tests/support/released_arm.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace dashpot {
namespace {

using analysis::Complex;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Integral of q(t) exp(-i omega t) over a record, in steps of h.
Eigen::VectorXcd transform(const MatrixXd& q, double h, double omega) {
  Eigen::VectorXcd sum = Eigen::VectorXcd::Zero(q.rows());
  Complex factor = 0.5 * h;  // the trapezoidal rule
  for (Eigen::Index k = 0; k < q.cols(); ++k) {
    sum += factor * q.col(k);
    factor = std::polar(h, -omega * h * static_cast<double>(k + 1));
  }
  return sum;
}

TEST(DominantModes, OfAPandaAreThePeaksOfTheTransform) {
  DASHPOT_SKIP_IF_QUICK();
  constexpr double kPeriod = 5e-4;
  constexpr int kTicks = 100'000, kEvery = 20;
  testing::Random random(2023);
  const testing::TwinModels twin(testing::arms()[0], false);
  ASSERT_EQ(twin.dof(), 7);
  const controller::JointVector q0 = random_posture(twin, random);
  VectorXd omega(6);
  omega << 10, 14, 19, 25, 32, 40;
  controller::Gains gains = tip_gains(twin, q0, omega, VectorXd::Constant(6, 0.02), 0.3, random);
  const double softness = self_motion(twin, q0).squaredNorm();
  gains.null_stiffness.setConstant(49 / softness);
  gains.null_damping.setConstant(2 * 0.02 * 7 / softness);
  const controller::JointVector dq = 1e-5 * random.vector(7);
  testing::ReleasedArm arm(twin, testing::release_settings(twin, gains, kPeriod), q0, dq);
  const MatrixXd motion = arm.record(q0, kTicks, kEvery).position;
  ASSERT_EQ(arm.worst, controller::Status::kOk);

  const analysis::System<> system = controller::unbounded(arm.closed_loop);
  const analysis::Spectrum<> spectrum = analysis::analyze(system);
  analysis::SampledLoop loop;
  loop.period = kPeriod;
  loop.gravity_gradient = twin.gravity_gradient(q0);
  const auto sampled = analysis::sample_loop(system, spectrum, loop).modes;
  const MatrixXd J = evaluate(twin.model, q0, controller::JointVector::Zero(7)).J.topRows(3);
  const analysis::ModeShares shares =
      analysis::mode_shares(system, spectrum, {VectorXd(dq), {}, {}, {}}, J);

  const auto height = [&](double w) {
    const Eigen::VectorXcd X = transform(motion, kEvery * kPeriod, w);
    return X.dot(system.mass * X).real();
  };
  std::vector<double> peaks;
  const double kStep = 0.05;
  double before = 0, now = height(4);
  for (double w = 4 + kStep; w < 45; w += kStep) {
    const double next = height(w);
    if (now > before && now > next) peaks.push_back(w - kStep);
    before = now, now = next;
  }
  VectorXd energy(7);
  MatrixXd amplitude(3, 7);
  for (int i = 0; i < 7; ++i) {
    const Complex lambda = sampled[static_cast<std::size_t>(i)].eigenvalues[0];
    const auto apart = [&](double w) { return std::abs(w - lambda.imag()); };
    if (shares.energy[i] > 0.02) {
      const double nearest = *std::min_element(
          peaks.begin(), peaks.end(), [&](double a, double b) { return apart(a) < apart(b); });
      EXPECT_LT(apart(nearest), kStep + 0.01 * lambda.imag()) << i;
    }
    // A mode Re(c exp(lambda t)) has the transform c / (-2 Re lambda) at its peak.
    const Eigen::VectorXcd c =
        -2 * lambda.real() * transform(motion, kEvery * kPeriod, lambda.imag());
    const VectorXd q = c.real(), v = (lambda * c).real();
    energy[i] = q.dot(system.stiffness * q) + v.dot(system.mass * v);
    amplitude.col(i) = (J * c).cwiseAbs();
  }
  energy /= energy.sum();
  for (int i = 0; i < 7; ++i) {
    std::printf("%6.2f rad/s: energy %.4f predicted, %.4f transformed; tip %.3g %.3g um\n",
                spectrum.modes[i].natural_frequency, shares.energy[i], energy[i],
                1e6 * shares.amplitude.col(i).norm(), 1e6 * amplitude.col(i).norm());
  }
  EXPECT_LT((energy - shares.energy).cwiseAbs().maxCoeff(), 0.02);
  EXPECT_LT((amplitude - shares.amplitude).cwiseAbs().maxCoeff(),
            0.05 * shares.amplitude.maxCoeff());
}

}  // namespace
}  // namespace dashpot
