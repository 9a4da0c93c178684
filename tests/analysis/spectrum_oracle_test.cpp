// Spectra against references of 50 digits: every error is inside the bound that comes with the
// result.
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/tests/support/oracle.hpp>
#include <dashpot/tests/support/proved_eigenvalues.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace dashpot::analysis {
namespace {

using testing::kInfinity;
using testing::LongComplex;
using testing::ReferenceEigenvalue;
using testing::SpectrumCase;
using LongComplexMatrix = Eigen::Matrix<LongComplex, Eigen::Dynamic, Eigen::Dynamic>;

System<> system_of(const SpectrumCase& reference) {
  System<> system(reference.n);
  system.mass = reference.mass;
  system.damping = reference.damping;
  system.stiffness = reference.stiffness;
  return system;
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
    EXPECT_EQ(spectrum.zero_modes.count, reference.r);
    EXPECT_EQ(spectrum.modes.size(), reference.n - reference.r);
    // The eigenvalues of this one lie 1e-10 apart, and their vectors are all but parallel.
    const double limit = reference.name == "nearly_coinciding_n4_2^-33" ? 5e-13 : 1e-13;
    for (const Mode<>& mode : spectrum.modes) {
      const double computed = backward_error(system, mode);
      EXPECT_LE(computed, limit) << "at " << mode.eigenvalues[0];
      EXPECT_NEAR(mode.backward_error, computed, 2e-16 * (reference.n + 4));
    }
  }

  /// The eigenvalues of the modes, mode by mode, then those of the zero modes: 2n in all.
  std::vector<Complex> eigenvalues() const {
    std::vector<Complex> all;
    for (const Mode<>& mode : spectrum.modes) {
      all.insert(all.end(), mode.eigenvalues.begin(), mode.eigenvalues.end());
    }
    all.resize(all.size() + static_cast<std::size_t>(spectrum.zero_modes.count), 0.0);
    for (const double rate : spectrum.zero_mode_rates) all.emplace_back(rate);
    return all;
  }

  void expect_within(const char* what, int mode, long double error, double bound) {
    EXPECT_TRUE(error <= static_cast<long double>(bound) || bound == kInfinity)
        << "error " << error << ", bound " << bound << ": " << what << " of mode " << mode + 1
        << ", " << spectrum.modes[mode].eigenvalues[0];
  }

  /// Each number of each mode within its bound of the reference.
  void expect_enclosed() {
    if (HasFatalFailure()) return;
    const std::vector<Complex> computed = eigenvalues();
    ASSERT_EQ(computed.size(), reference.eigenvalues.size());
    const auto matches = testing::match_eigenvalues(computed, reference.eigenvalues);
    for (int i = 0; i < spectrum.modes.size(); ++i) {
      const Mode<>& mode = spectrum.modes[i];
      const auto k = 2 * static_cast<std::size_t>(i);
      expect_within("first eigenvalue", i, matches[k].absolute, mode.error_bound);
      expect_within("second eigenvalue", i, matches[k + 1].absolute, mode.error_bound);
      const ReferenceEigenvalue& first = reference.eigenvalues[matches[k].reference];
      const ReferenceEigenvalue& second = reference.eigenvalues[matches[k + 1].reference];
      const LongComplex a = first.value();
      const LongComplex b = first.is_real() ? second.value() : std::conj(a);
      const long double product = (a * b).real();
      if (!(product > 0)) continue;
      const long double omega = std::sqrt(product);
      const long double zeta = -(a + b).real() / (2 * omega);
      expect_within("natural frequency", i,
                    std::abs(static_cast<long double>(mode.natural_frequency) - omega),
                    mode.natural_frequency_bound);
      expect_within("damping ratio", i,
                    std::abs(static_cast<long double>(mode.damping_ratio) - zeta),
                    mode.damping_ratio_bound);
    }
  }

  /// Eigenvalues of zero modes come without a bound: as good as the data's condition allows.
  void expect_zero_mode_rates() const {
    if (HasFatalFailure()) return;
    const std::vector<Complex> computed = eigenvalues();
    const auto matches = testing::match_eigenvalues(computed, reference.eigenvalues);
    for (std::size_t k = 2 * static_cast<std::size_t>(spectrum.modes.size()); k < computed.size();
         ++k) {
      const ReferenceEigenvalue& truth = reference.eigenvalues[matches[k].reference];
      if (truth.is_zero()) {
        EXPECT_EQ(computed[k], 0.0);
      } else {
        EXPECT_LE(matches[k].relative, 1e-14 + 2e-16 * truth.condition) << truth;
      }
    }
  }

  const SpectrumCase reference = testing::spectrum_case(GetParam());
  System<> system = system_of(reference);
  Spectrum<> spectrum;
};

std::string alphanumeric(const ::testing::TestParamInfo<std::string>& instance) {
  std::string name;
  for (const char c : instance.param) {
    if (c == '+') name += "_plus_";
    if (c == '-') name += "_minus_";
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  }
  return name;
}

INSTANTIATE_TEST_SUITE_P(Systems, SpectrumOracle, ::testing::ValuesIn(testing::spectrum_names()),
                         alphanumeric);

/// Whatever the residual, with the stiffness factor and without it.
TEST_P(SpectrumOracle, EnclosesTheTruth) {
  using Residual = SpectrumOptions::Residual;
  for (const bool factored : {false, true}) {
    if (factored && !reference.stiffness_factor) continue;
    if (factored) system.stiffness_factor = *reference.stiffness_factor;
    for (const Residual residual :
         {Residual::kAutomatic, Residual::kExtended, Residual::kWorking}) {
      SCOPED_TRACE(::testing::Message()
                   << "residual " << static_cast<int>(residual) << ", factored " << factored);
      const Status status = solve(residual);
      if (residual != Residual::kAutomatic) {
        EXPECT_EQ(spectrum.extended, residual == Residual::kExtended);
      }
      if (residual ==
          Residual::kWorking) {  // whatever the status: an infinite bound holds anything
        EXPECT_TRUE(status == Status::kOk || status == Status::kUncertified) << to_text(status);
      } else {
        expect_complete();
        expect_zero_mode_rates();
      }
      expect_enclosed();
    }
  }
}

#if defined(DASHPOT_HAVE_ARB)
/// Whether hi + lo is a part of a root to 31 digits, or both are zero.
bool same_part(double hi, double lo, const arb_t part, double size) {
  constexpr slong kBits = 400;
  arb_t off, low;
  mag_t most;
  arb_init(off), arb_init(low), mag_init(most);
  arb_set_d(off, hi), arb_set_d(low, lo);
  arb_add(off, off, low, kBits);
  arb_sub(off, off, part, kBits);
  arb_get_mag(most, off);
  const double largest = mag_get_d(most);
  arb_clear(off), arb_clear(low), mag_clear(most);
  return largest <= 1e-31 * std::abs(hi) + 1e-80 * size;
}
#endif

/// The references are the roots of the exact polynomial that Arb encloses, as often as these are.
TEST_P(SpectrumOracle, IsWhatArbProves) {
  DASHPOT_SKIP_IF_QUICK();
#if defined(DASHPOT_HAVE_ARB)
  std::vector<ReferenceEigenvalue> left = reference.eigenvalues;
  testing::for_each_eigenvalue(system, 300, [&](const acb_t root) {
    const auto same = std::find_if(left.begin(), left.end(), [&](const ReferenceEigenvalue& z) {
      const double size = std::hypot(z.re_hi, z.im_hi);
      return same_part(z.re_hi, z.re_lo, acb_realref(root), size) &&
             same_part(z.im_hi, z.im_lo, acb_imagref(root), size);
    });
    EXPECT_NE(same, left.end()) << arf_get_d(arb_midref(acb_realref(root)), ARF_RND_NEAR);
    if (same != left.end()) left.erase(same);
  });
  for (const ReferenceEigenvalue& z : left) ADD_FAILURE() << z;
#else
  GTEST_SKIP() << "FLINT/Arb is not installed (libflint-arb-dev, libflint-dev)";
#endif
}

}  // namespace
}  // namespace dashpot::analysis
