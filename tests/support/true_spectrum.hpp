#pragma once
// Eigenvalues in long double by another algorithm (Hessenberg QR on the state matrix in energy
// coordinates), and the check that published bounds enclose them.

#include <dashpot/analysis/mode_tracker.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <vector>

namespace dashpot::testing {

/// Of [0 J; -J' -D], with M = L L', D = L^-1 C L^-T and J = W L^-T (p x n): p + n of them. Without
/// a factor W, J is the transposed Cholesky factor of L^-1 K L^-T.
inline std::vector<LongComplex> true_eigenvalues(
    const analysis::System<analysis::kMaxDof>& system) {
  const Eigen::Index n = system.dof();
  const LongMatrix L = LongMatrix(system.mass.cast<long double>()).llt().matrixL();
  const auto lower = L.triangularView<Eigen::Lower>();
  const LongMatrix CL = lower.solve(LongMatrix(system.damping.cast<long double>()));
  const LongMatrix D = lower.solve(LongMatrix(CL.transpose()));
  LongMatrix J;
  if (system.stiffness_factor.rows() > 0) {
    J = lower.solve(LongMatrix(system.stiffness_factor.transpose().cast<long double>()))
            .transpose();
  } else {
    const LongMatrix KL = lower.solve(LongMatrix(system.stiffness.cast<long double>()));
    J = LongMatrix(lower.solve(LongMatrix(KL.transpose()))).llt().matrixU();
  }
  const Eigen::Index p = J.rows();
  LongMatrix A = LongMatrix::Zero(p + n, p + n);
  A.topRightCorner(p, n) = J;
  A.bottomLeftCorner(n, p) = -J.transpose();
  A.bottomRightCorner(n, n) = -D;
  const auto values = Eigen::EigenSolver<LongMatrix>(A, false).eigenvalues().eval();
  return {values.begin(), values.end()};
}

struct Enclosure {
  double tightest = 0;  ///< largest error / bound
  double widest = 0;    ///< largest bound / |eigenvalue|
};

/// Expects each eigenvalue within its bound of a true one, one to one; and frequency and damping
/// ratio within theirs, where the two true eigenvalues of the mode are clear.
inline Enclosure expect_enclosed(const analysis::System<analysis::kMaxDof>& system,
                                 const analysis::TrackedSpectrum& spectrum) {
  Enclosure seen;
  std::vector<LongComplex> truth = true_eigenvalues(system);
  long double size = 0;
  for (const LongComplex& z : truth) size = std::max(size, std::abs(z));
  const long double slack = 1e-17L * size;  // of the truth itself
  for (int i = 0; i < spectrum.mode_count; ++i) {
    const analysis::ModeNumbers& mode = spectrum.modes[static_cast<std::size_t>(i)];
    std::array<LongComplex, 2> found;
    bool clear = true;
    for (std::size_t k = 0; k < 2; ++k) {
      const LongComplex computed(mode.eigenvalues[k]);
      const auto nearest = std::min_element(
          truth.begin(), truth.end(), [&](const LongComplex& a, const LongComplex& b) {
            return std::abs(a - computed) < std::abs(b - computed);
          });
      if (nearest == truth.end()) {
        ADD_FAILURE() << "more modes than eigenvalues";
        return seen;
      }
      found[k] = *nearest;
      const auto error = std::abs(*nearest - computed);
      truth.erase(nearest);
      const auto bound = static_cast<long double>(mode.error_bound);
      EXPECT_LE(error, bound + slack)
          << "mode " << i << " at " << mode.eigenvalues[k] << ", zeta " << mode.damping_ratio;
      seen.tightest =
          std::max(seen.tightest, static_cast<double>(std::max(error - slack, 0.0L) / bound));
      if (std::abs(computed) > 0) {
        seen.widest = std::max(seen.widest, static_cast<double>(bound / std::abs(computed)));
      }
      for (const LongComplex& other : truth)
        clear = clear && std::abs(other - computed) > 4 * bound;
    }
    const long double product = (found[0] * found[1]).real();
    if (!clear || !(product > 0) || std::isnan(mode.natural_frequency)) continue;
    const long double omega = std::sqrt(product);
    const long double zeta = -(found[0] + found[1]).real() / (2 * omega);
    EXPECT_LE(std::abs(static_cast<long double>(mode.natural_frequency) - omega),
              static_cast<long double>(mode.natural_frequency_bound) + slack);
    EXPECT_LE(std::abs(static_cast<long double>(mode.damping_ratio) - zeta),
              static_cast<long double>(mode.damping_ratio_bound) + slack / omega);
  }
  return seen;
}

}  // namespace dashpot::testing
