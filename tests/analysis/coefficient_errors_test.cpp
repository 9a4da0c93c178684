// The bounds include errors of the coefficients: rounding errors beyond double-doubles, matrices
// that are symmetric to 1e-10.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/task_space.hpp>
#include <dashpot/analysis/tracker/tracked_start.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/quad_matrix.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/special_values.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <numeric>

namespace dashpot::analysis {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Quad;
using testing::Random;

/// x and y with a x + b y = 1, for coprime a and b.
std::pair<std::int64_t, std::int64_t> bezout(std::int64_t a, std::int64_t b) {
  if (b == 0) return {1, 0};
  const auto [x, y] = bezout(b, a % b);
  return {y, x - (a / b) * y};
}

/// Springs K_C = [0 c; c d] at one joint of mass 1, whose Jacobian is (j, k). All numbers are
/// integers below 2^bits with 2 c j + d k = 1, so that J' K_C J = 2 c j k + d k^2 = k exactly.
TaskImpedance cancelling(Random& random, int bits) {
  const std::int64_t low = std::int64_t{1} << (bits - 1);
  const auto draw = [&] {
    return low + std::uniform_int_distribution<std::int64_t>(0, low - 1)(random.engine());
  };
  std::int64_t c = 0, k = 0;
  while (std::gcd(2 * c, k) != 1) {
    c = draw() / 2;
    k = draw();
  }
  auto [j, d] = bezout(2 * c, k);
  if (j < 0) {
    j += k;
    d -= 2 * c;
  }
  TaskImpedance impedance;
  impedance.mass = MatrixXd::Identity(1, 1);
  impedance.jacobian = VectorXd{{static_cast<double>(j), static_cast<double>(k)}};
  impedance.task_stiffness = MatrixXd(2, 2);
  *impedance.task_stiffness << 0, static_cast<double>(c), static_cast<double>(c),
      static_cast<double>(d);
  return impedance;
}

TEST(CoefficientErrors, CountWhatTheProductOfAFactorLacks) {
  Random random(2105);
  double share = 0;
  for (int trial = 0; trial < 400; ++trial) {
    System<kMaxDof> system(random.integer(2, 6));
    const Eigen::Index n = system.dof();
    system.stiffness_factor.resize(random.integer(1, 6), n);
    auto& W = system.stiffness_factor;
    for (double& entry : W.reshaped()) entry = random.uniform(-1, 1);
    W.col(n - 1) *= 1e8;  // graded, and its product with the first column cancels
    W(0, n - 1) -= W.col(0).dot(W.col(n - 1)) / W(0, 0);
    form_stiffness(system);
    System<kMaxDof> again = system;
    again.stiffness_error.setConstant(1);
    form_stiffness(again);  // beside errors that were there
    EXPECT_EQ(again.stiffness_error, MatrixXd(system.stiffness_error.array() + 1));
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) {
        Quad lacking = -static_cast<Quad>(system.stiffness(i, j)) -
                       static_cast<Quad>(system.stiffness_low(i, j));
        for (Eigen::Index k = 0; k < W.rows(); ++k) {
          lacking += static_cast<Quad>(W(k, i)) * static_cast<Quad>(W(k, j));
        }
        const auto lost = static_cast<double>(testing::magnitude(lacking));
        EXPECT_LE(lost, system.stiffness_error(i, j)) << "trial " << trial;
        if (lost > 0) share = std::max(share, lost / system.stiffness_error(i, j));
      }
    }
  }
  EXPECT_GT(share, 0.01);
}

TEST(CoefficientErrors, CountWhatCancelsBeyondDoubleDoubles) {
  Random random(2101);
  int exact = 0, wrong = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const int bits = 20 + trial % 33;
    const TaskImpedance impedance = cancelling(random, bits);
    const double stiffness = (*impedance.jacobian)(1, 0), omega = std::sqrt(stiffness);
    const System<> system = to_joint_space(impedance);
    const double low = system.has_low_words ? system.stiffness_low(0, 0) : 0;
    const double lost = std::abs((system.stiffness(0, 0) - stiffness) + low);
    EXPECT_LE(lost, system.stiffness_error(0, 0)) << bits << " bits";
    const Spectrum<> spectrum = analyze(system);
    const bool found = spectrum.modes.size() == 1;
    if (found) {
      const Mode<>& mode = spectrum.modes[0];
      EXPECT_TRUE(!std::isfinite(mode.natural_frequency_bound) ||
                  std::abs(mode.natural_frequency - omega) <= mode.natural_frequency_bound)
          << mode.natural_frequency << " for " << omega << ", bound "
          << mode.natural_frequency_bound << ", " << bits << " bits";
      exact += mode.natural_frequency_bound < 1e-14 * omega ? 1 : 0;
    }
    wrong += !found || !(std::abs(spectrum.modes[0].natural_frequency - omega) < 1e-5 * omega);
  }
  EXPECT_GT(exact, 50);
  EXPECT_GT(wrong, 10);
}

/// Expects every published eigenvalue within its bound of a true one.
void expect_enclosed(const System<>& truth, const Spectrum<>& spectrum, double& largest) {
  const auto exact = testing::proved_eigenvalues(truth);
  for (const Mode<>& mode : spectrum.modes) {
    for (const Complex& value : mode.eigenvalues) {
      const auto error = static_cast<double>(testing::distance_to_nearest(value, exact));
      EXPECT_LE(error, mode.error_bound) << value;
      largest = std::max(largest, error / mode.error_bound);
    }
  }
}

TEST(CoefficientErrors, CountAsymmetryThatIsAveraged) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  // A skew part counts where modes coincide, to first order: elsewhere to second order.
  Random random(2102);
  for (const int part : {0, 1, 2}) {
    double largest = 0;
    for (int trial = 0; trial < 8; ++trial) {
      const int n = random.integer(2, 4);
      TaskImpedance given;
      given.mass = 2 * MatrixXd::Identity(n, n);
      given.damping = MatrixXd::Identity(n, n);
      given.stiffness = 40 * MatrixXd::Identity(n, n);
      MatrixXd& matrix = part == 0 ? given.mass : part == 1 ? *given.damping : *given.stiffness;
      const MatrixXd half = random.matrix(n, n), skew = half - half.transpose();
      matrix += random.log_uniform(1e-13, 4e-11) * matrix(0, 0) / skew.cwiseAbs().maxCoeff() * skew;
      const System<> exact = testing::system_from(given.mass, *given.damping, *given.stiffness);
      expect_enclosed(exact, analyze(to_joint_space(given)), largest);
      if (part == 0) expect_enclosed(exact, analyze(exact), largest);
    }
    EXPECT_GT(largest, 1e-3) << "part " << part;
  }
}

TEST(CoefficientErrors, CountAsymmetryOfTaskMatrices) {
  Random random(2103);
  for (int trial = 0; trial < 30; ++trial) {
    TaskImpedance given;
    given.mass = random.spd(3);
    given.jacobian = random.matrix(3, 3);
    MatrixXd K = 40 * random.spd(3), C = random.spd(3);
    K(0, 1) += 3e-11 * K.maxCoeff();
    C(0, 2) -= 3e-11 * C.maxCoeff();
    given.task_stiffness = K;
    given.task_damping = C;
    const System<> system = to_joint_space(given);
    const auto lost = [&](const MatrixXd& middle, const MatrixXd& result) {
      return MatrixXd(((given.jacobian->transpose().cast<long double>() *
                        middle.cast<long double>() * given.jacobian->cast<long double>()) -
                       result.cast<long double>())
                          .cwiseAbs()
                          .cast<double>());
    };
    const double rounding = 1e-14;
    EXPECT_TRUE((lost(K, system.stiffness).array() <=
                 system.stiffness_error.array() + rounding * system.stiffness.norm())
                    .all());
    EXPECT_TRUE((lost(C, system.damping).array() <=
                 system.damping_error.array() + rounding * system.damping.norm())
                    .all());
    EXPECT_GT(lost(K, system.stiffness).maxCoeff(), 10 * rounding * system.stiffness.norm());
  }
}

TEST(CoefficientErrors, OfAllCoefficientsAreInTheBounds) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  // Any system within the errors has its eigenvalues within the bounds.
  Random random(2104);
  double largest = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const int n = random.integer(1, 4);
    System<> system = testing::system_from(random.spd(n), 0.3 * random.spd(n), 40 * random.spd(n));
    System<> other = system;
    const double size = random.log_uniform(1e-12, 1e-6);
    const auto disturb = [&](const MatrixXd& given, MatrixXd& error, MatrixXd& truth) {
      if (random.integer(0, 1) == 0) return;
      error = size * given.norm() * random.matrix(n, n).cwiseAbs();
      for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index i = 0; i < n; ++i) {
          truth(i, j) += (random.integer(0, 1) == 0 ? 0.999 : -0.999) * error(i, j);
        }
      }
    };
    disturb(system.mass, system.mass_error, other.mass);
    disturb(system.damping, system.damping_error, other.damping);
    disturb(system.stiffness, system.stiffness_error, other.stiffness);
    expect_enclosed(other, analyze(system), largest);
  }
  EXPECT_GT(largest, 0.05);
}

}  // namespace
}  // namespace dashpot::analysis
