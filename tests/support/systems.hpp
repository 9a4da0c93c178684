#pragma once
// Shared by tests of systems {M, C, K}.

#include <dashpot/analysis/system.hpp>
#include <dashpot/tests/support/special_values.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
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

/// Returns an iterator to the value of `all` nearest to this.
template <class Values>
auto nearest_to(const LongComplex& value, Values& all) {
  return std::min_element(all.begin(), all.end(), [&](const LongComplex& a, const LongComplex& b) {
    return std::abs(a - value) < std::abs(b - value);
  });
}

inline long double distance_to_nearest(const LongComplex& value,
                                       const std::vector<LongComplex>& all) {
  return all.empty() ? static_cast<long double>(kInfinity)
                     : std::abs(*nearest_to(value, all) - value);
}

/// Largest distance when each computed eigenvalue takes the nearest true one that is left.
inline double worst_distance(const std::vector<analysis::Complex>& computed,
                             std::vector<LongComplex> truth) {
  if (computed.size() != truth.size()) return kInfinity;
  long double worst = 0;
  for (const analysis::Complex& value : computed) {
    const auto nearest = nearest_to(value, truth);
    worst = std::max(worst, std::abs(*nearest - LongComplex(value)));
    truth.erase(nearest);
  }
  return static_cast<double>(worst);
}

/// State matrix [0 J; -J' -D], with M = L L', D = L^-1 C L^-T and J = W L^-T (p x n). Without a
/// factor W, J is the transposed Cholesky factor of L^-1 K L^-T. Where K has none, it is
/// [0 I; -L^-1 K L^-T -D].
template <int N>
LongMatrix energy_state_matrix(const analysis::System<N>& system) {
  const auto wide = [](const auto& A) { return LongMatrix(A.template cast<long double>()); };
  const Eigen::Index n = system.dof();
  const LongMatrix L = wide(system.mass).llt().matrixL();
  const auto lower = L.triangularView<Eigen::Lower>();
  const auto congruent = [&](const auto& A) {
    const LongMatrix half = lower.solve(wide(A));
    return LongMatrix(lower.solve(LongMatrix(half.transpose())).transpose());
  };
  LongMatrix J, minus_pull;
  if (system.stiffness_factor.rows() > 0) {
    J = lower.solve(LongMatrix(wide(system.stiffness_factor).transpose())).transpose();
    minus_pull = J.transpose();
  } else {
    const LongMatrix K = congruent(system.stiffness);
    const Eigen::LLT<LongMatrix> cholesky(K);
    const bool definite =
        system.stiffness == system.stiffness.transpose() && cholesky.info() == Eigen::Success;
    J = definite ? LongMatrix(cholesky.matrixU()) : LongMatrix(LongMatrix::Identity(n, n));
    minus_pull = definite ? LongMatrix(J.transpose()) : K;
  }
  const Eigen::Index p = J.rows();
  LongMatrix A(p + n, p + n);
  A << LongMatrix::Zero(p, p), J, -minus_pull, -congruent(system.damping);
  return A;
}

/// Eigenvalues in long double, of the modes and the rates of zero modes, with their zeros if K has
/// no factor.
template <int N>
std::vector<LongComplex> true_eigenvalues(const analysis::System<N>& system) {
  return eigenvalues_by_eigen(energy_state_matrix(system));
}

}  // namespace dashpot::testing
