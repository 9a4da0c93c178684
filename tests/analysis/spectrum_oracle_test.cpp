// Spectra of hard systems against the roots of their exact polynomials: every error is inside the
// bound that comes with the result.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/oracle.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace dashpot::analysis {
namespace {

using testing::kInfinity;
using testing::LongComplex;
using LongComplexMatrix = Eigen::Matrix<LongComplex, Eigen::Dynamic, Eigen::Dynamic>;

const testing::SystemFile& spectra() {
  static const testing::SystemFile file("spectra.json");
  return file;
}

/// Largest backward error of the mode's right eigenpairs, in long double.
double backward_error(const System<>& system, const Mode<>& mode) {
  const LongComplexMatrix M = system.mass.cast<LongComplex>();
  const LongComplexMatrix C = system.damping.cast<LongComplex>();
  const LongComplexMatrix K = system.stiffness.cast<LongComplex>();
  long double worst = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    const LongComplex lambda = mode.eigenvalues[k];
    const LongComplexMatrix u = mode.shapes[k].cast<LongComplex>();
    const long double residual = (lambda * lambda * (M * u) + lambda * (C * u) + K * u).norm();
    const long double size =
        (std::norm(lambda) * M.norm() + std::abs(lambda) * C.norm() + K.norm()) * u.norm();
    worst = std::max(worst, residual / size);
  }
  return static_cast<double>(worst);
}

class SpectrumOracle : public ::testing::TestWithParam<std::string> {
 protected:
  Status solve(SpectrumOptions::Residual residual) {
    SpectrumOptions options;
    options.residual = residual;
    return SpectrumSolver<>(options).solve(system, spectrum);
  }

  /// Everything but the accuracy of eigenvalues.
  void expect_complete() const {
    ASSERT_EQ(spectrum.status, Status::kOk) << to_text(spectrum.status);
    EXPECT_TRUE(spectrum.symmetric);
    const int r = reference.at("r"), n = reference.at("n");
    EXPECT_EQ(spectrum.zero_modes.count, r);
    EXPECT_EQ(spectrum.modes.size(), n - r);
    // The eigenvalues of this one lie 1e-10 apart, and their vectors are all but parallel.
    const double limit = GetParam() == "nearly_coinciding_n4_2^-33" ? 5e-13 : 1e-13;
    for (const Mode<>& mode : spectrum.modes) {
      const double computed = backward_error(system, mode);
      EXPECT_LE(computed, limit) << "at " << mode.eigenvalues[0];
      EXPECT_NEAR(mode.backward_error, computed, 2e-16 * (n + 4));
    }
  }

  /// Takes the true eigenvalue that is nearest.
  static LongComplex take(Complex value, std::vector<LongComplex>& left) {
    const auto nearest = testing::nearest_to(value, left);
    const LongComplex taken = *nearest;
    left.erase(nearest);
    return taken;
  }

  static void expect_within(const char* what, long double error, double bound) {
    EXPECT_TRUE(error <= static_cast<long double>(bound) || bound == kInfinity)
        << what << ": error " << error << ", bound " << bound;
  }

  /// Each number of each mode, and each rate of a zero mode, within its bound.
  void expect_enclosed() {
    if (HasFatalFailure()) return;
    std::vector<LongComplex> left = truth;
    for (const Mode<>& mode : spectrum.modes) {
      SCOPED_TRACE(::testing::Message() << "mode at " << mode.eigenvalues[0]);
      std::array<LongComplex, 2> both;
      for (std::size_t k = 0; k < 2; ++k) {
        both[k] = take(mode.eigenvalues[k], left);
        expect_within("eigenvalue", std::abs(LongComplex(mode.eigenvalues[k]) - both[k]),
                      mode.error_bound);
      }
      const LongComplex a = both[0], b = a.imag() == 0 ? both[1] : std::conj(a);
      const long double product = (a * b).real();
      if (!(product > 0)) continue;
      const long double omega = std::sqrt(product), zeta = -(a + b).real() / (2 * omega);
      expect_within("natural frequency",
                    std::abs(static_cast<long double>(mode.natural_frequency) - omega),
                    mode.natural_frequency_bound);
      expect_within("damping ratio", std::abs(static_cast<long double>(mode.damping_ratio) - zeta),
                    mode.damping_ratio_bound);
    }
    for (int i = 0; i < spectrum.zero_modes.count; ++i) {
      EXPECT_EQ(take(0, left), LongComplex(0));
    }
    for (Eigen::Index i = 0; i < spectrum.zero_mode_rates.size(); ++i) {
      const Complex rate = spectrum.zero_mode_rates[i];
      const LongComplex exact = take(rate, left);
      if (exact == LongComplex(0)) EXPECT_EQ(rate, 0.0);
      expect_within("rate", std::abs(LongComplex(rate) - exact), spectrum.zero_mode_rates_bound[i]);
    }
    EXPECT_TRUE(left.empty());
  }

  const testing::Json reference = spectra().read(GetParam());
  System<> system = testing::to_system(reference);
  const std::vector<LongComplex> truth = testing::exact_eigenvalues(system);
  Spectrum<> spectrum;
};

INSTANTIATE_TEST_SUITE_P(Systems, SpectrumOracle, ::testing::ValuesIn(spectra().names),
                         [](const auto& instance) {
                           return testing::alphanumeric(instance.param);
                         });

/// Whatever the residual, with the stiffness factor and without it.
TEST_P(SpectrumOracle, EnclosesTheTruth) {
  DASHPOT_NEEDS_PROVED_EIGENVALUES();
  using Residual = SpectrumOptions::Residual;
  for (const bool factored : {false, true}) {
    if (factored && !reference.contains("stiffness_factor")) continue;
    if (factored) system.stiffness_factor = testing::to_matrix(reference["stiffness_factor"]);
    for (const Residual residual :
         {Residual::kAutomatic, Residual::kExtended, Residual::kWorking}) {
      SCOPED_TRACE(::testing::Message()
                   << "residual " << static_cast<int>(residual) << ", factored " << factored);
      const Status status = solve(residual);
      if (residual != Residual::kAutomatic) {
        EXPECT_EQ(spectrum.extended, residual == Residual::kExtended);
      }
      if (residual == Residual::kWorking) {  // an infinite bound holds anything
        EXPECT_TRUE(status == Status::kOk || status == Status::kUncertified) << to_text(status);
      } else {
        expect_complete();
      }
      expect_enclosed();
    }
  }
}

}  // namespace
}  // namespace dashpot::analysis
