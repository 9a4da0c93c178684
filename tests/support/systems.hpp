#pragma once
// What tests of systems {M, C, K} share.

#include <dashpot/analysis/system.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
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

/// Eigenvalues of [0 I; -M^-1 K  -M^-1 C] in long double, by Eigen.
inline std::vector<LongComplex> true_eigenvalues(const analysis::System<>& system) {
  const Eigen::Index n = system.dof();
  const auto lu = system.mass.cast<long double>().fullPivLu();
  LongMatrix A(2 * n, 2 * n);
  A << LongMatrix::Zero(n, n), LongMatrix::Identity(n, n),
      -lu.solve(system.stiffness.cast<long double>()),
      -lu.solve(system.damping.cast<long double>());
  const auto values = Eigen::EigenSolver<LongMatrix>(A, false).eigenvalues().eval();
  return {values.begin(), values.end()};
}

}  // namespace dashpot::testing
