#include <dashpot/analysis/damping_target.hpp>
#include <dashpot/analysis/design/modal_damping.hpp>

#include <Eigen/Eigenvalues>
#include <cmath>

namespace dashpot::analysis {
namespace {

using Matrix = Square<kMaxDof>;
using Eigen::Index;

/// Whether T is positive definite, by elimination; of T the lower triangle is read.
bool definite(Matrix T) noexcept {
  const Index k = T.rows();
  for (Index j = 0; j < k; ++j) {
    if (!(T(j, j) > 0)) return false;
    for (Index c = j + 1; c < k; ++c) {
      const double factor = T(c, j) / T(j, j);
      for (Index i = c; i < k; ++i) T(i, c) -= factor * T(i, j);
    }
  }
  return true;
}

/// T without its negative eigenvalues; false if they were not found.
bool make_semidefinite(Matrix& T) noexcept {
  const Index k = T.rows();
  Eigen::SelfAdjointEigenSolver<Matrix> eigen(k);
  eigen.compute(T);
  if (eigen.info() != Eigen::Success) return false;
  const Matrix& V = eigen.eigenvectors();
  T.setZero();
  for (Index l = 0; l < k; ++l) {
    const double value = eigen.eigenvalues()[l];
    if (!(value > 0)) continue;
    for (Index j = 0; j < k; ++j) {
      for (Index i = 0; i < k; ++i) T(i, j) += value * V(i, l) * V(j, l);
    }
  }
  return true;
}

}  // namespace

namespace {

/// The share of a mode's coupling that counts: 1 unless the present damping exceeds the wanted one;
/// then it falls to 0 with wanted / present, twice continuously differentiable.
double coupling_share(double wanted, double there) noexcept {
  if (!(there > wanted)) return 1;
  const double rest = 1 - wanted / there;
  return 1 - rest * rest * rest;
}

}  // namespace

Status missing_damping(const Vector<kMaxDof>& omega, const Vector<kMaxDof>& wanted, double soft,
                       Matrix& G, bool& overdone) noexcept {
  const Index k = omega.size();
  Vector<kMaxDof> S(k), share(k);
  for (Index i = 0; i < k; ++i) {
    share[i] = coupling_share(wanted[i], G(i, i));
  }
  for (Index i = 0; i < k; ++i) {
    const DampingTarget unit = DampingTarget::constant(1);
    S[i] = omega[i] > 0 ? std::sqrt(unit.damper(omega[i], soft) / (2 * omega[i])) : 0;
    for (Index j = 0; j < k; ++j) {
      if (j != i) G(i, j) *= -share[i] * share[j];
    }
    G(i, i) = S[i] > 0 ? wanted[i] - G(i, i) : 1;  // R is 0 there
  }
  overdone = !definite(G);
  if (overdone && !make_semidefinite(G)) return Status::kNotConverged;
  for (Index j = 0; j < k; ++j) {
    for (Index i = 0; i < k; ++i) G(i, j) *= S[i] * S[j];
  }
  return Status::kOk;
}

}  // namespace dashpot::analysis
