#pragma once
// What tests of systems {M, C, K} share.

#include <dashpot/analysis/system.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <complex>
#include <vector>

namespace dashpot::testing {

using LongComplex = std::complex<long double>;
using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

inline Eigen::MatrixXd symmetrized(const Eigen::MatrixXd& A) {
  return 0.5 * (A + A.transpose());
}

inline analysis::System<> system_from(const Eigen::MatrixXd& mass, const Eigen::MatrixXd& damping,
                                      const Eigen::MatrixXd& stiffness) {
  analysis::System<> system(mass.rows());
  system.mass = mass;
  system.damping = damping;
  system.stiffness = stiffness;
  return system;
}

inline analysis::System<> one_joint(double mass, double damping, double stiffness) {
  const auto entry = [](double value) { return Eigen::MatrixXd::Constant(1, 1, value); };
  return system_from(entry(mass), entry(damping), entry(stiffness));
}

inline std::vector<LongComplex> eigenvalues_by_eigen(const LongMatrix& A) {
  const auto values = Eigen::EigenSolver<LongMatrix>(A, false).eigenvalues().eval();
  return {values.begin(), values.end()};
}

/// Largest distance when each computed eigenvalue takes the nearest true one that is left.
inline double worst_distance(const std::vector<analysis::Complex>& computed,
                             std::vector<LongComplex> truth) {
  if (computed.size() != truth.size()) return kInfinity;
  long double worst = 0;
  for (const analysis::Complex& value : computed) {
    const auto away = [&](const LongComplex& z) { return std::abs(z - LongComplex(value)); };
    const auto nearest =
        std::min_element(truth.begin(), truth.end(),
                         [&](const auto& a, const auto& b) { return away(a) < away(b); });
    worst = std::max(worst, away(*nearest));
    truth.erase(nearest);
  }
  return static_cast<double>(worst);
}

/// Eigenvalues of [0 I; -M^-1 K  -M^-1 C] in long double.
inline std::vector<LongComplex> true_eigenvalues(const analysis::System<>& system) {
  const Eigen::Index n = system.dof();
  const auto lu = system.mass.cast<long double>().fullPivLu();
  LongMatrix A(2 * n, 2 * n);
  A << LongMatrix::Zero(n, n), LongMatrix::Identity(n, n),
      -lu.solve(system.stiffness.cast<long double>()),
      -lu.solve(system.damping.cast<long double>());
  return eigenvalues_by_eigen(A);
}

}  // namespace dashpot::testing
