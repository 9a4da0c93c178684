#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Index;

/// 1 / |R^-1| (Frobenius) of an upper triangular matrix; zero if it is singular.
template <int N>
double least_singular_value(const Square<N>& R) noexcept {
  if ((R.diagonal().array() == 0).any()) return 0;
  const Index m = R.rows();
  Square<N> inverse = Square<N>::Identity(m, m);
  R.template triangularView<Eigen::Upper>().solveInPlace(inverse);
  return 1 / inverse.norm();
}

}  // namespace

template <int N>
Status to_elastic_form(const System<N>& system, ElasticForm<N>& out) noexcept {
  const Index n = system.dof(), rows = system.stiffness_factor.rows();
  const Eigen::LLT<Square<N>> cholesky(system.mass);
  if (cholesky.info() != Eigen::Success) return Status::kMassNotPositiveDefinite;
  out.coordinates.setIdentity(n, n);
  cholesky.matrixU().solveInPlace(out.coordinates);
  if (rows <= n) {
    Square<N> B = system.stiffness_factor.transpose();
    cholesky.matrixL().solveInPlace(B);
    const Eigen::HouseholderQR<Square<N>> qr(B);
    out.coordinates.applyOnTheRight(qr.householderQ());
    out.root = qr.matrixQR().topRows(rows).template triangularView<Eigen::Upper>();
    out.slowest = least_singular_value<N>(out.root);
  } else {
    const StiffnessFactor<N> B = system.stiffness_factor.lazyProduct(out.coordinates);
    const Eigen::HouseholderQR<StiffnessFactor<N>> qr(B);
    out.root = qr.matrixQR().topRows(n).template triangularView<Eigen::Upper>();
    out.slowest = least_singular_value<N>(out.root);
    out.root.transposeInPlace();
  }
  if (out.modes() == 0) out.slowest = std::numeric_limits<double>::infinity();
  const Square<N> transposed = out.coordinates.transpose();
  Square<N> half;
  multiply(system.damping, out.coordinates, half);
  multiply(transposed, half, out.damping);
  const double all = out.damping.norm(), zero = out.damping.rightCols(n - out.modes()).norm();
  out.free_zero_modes = zero <= 8 * static_cast<double>(n) * kEps * all;
  return std::isfinite(all + out.root.norm()) ? Status::kOk : Status::kNotFinite;
}

template <int N>
Status elastic_eigenvalues(
    const ElasticForm<N>& form,
    Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1>& out) noexcept {
  const Index m = form.modes(), c = form.free_zero_modes ? m : form.damping.rows();
  State<N> A = State<N>::Zero(m + c, m + c);
  A.block(0, m, m, m) = form.root.transpose();
  A.block(m, 0, m, m) = -form.root;
  A.bottomRightCorner(c, c) = -form.damping.topLeftCorner(c, c);
  reduce_to_hessenberg(A);
  out.resize(m + c);
  return hessenberg_eigenvalues(A, out.data()) ? Status::kOk : Status::kNotConverged;
}

template Status to_elastic_form(const System<kDynamic>&, ElasticForm<kDynamic>&) noexcept;
template Status to_elastic_form(const System<kMaxDof>&, ElasticForm<kMaxDof>&) noexcept;
template Status elastic_eigenvalues(const ElasticForm<kDynamic>&, Eigen::VectorXcd&) noexcept;
template Status elastic_eigenvalues(
    const ElasticForm<kMaxDof>&,
    Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, 2 * kMaxDof, 1>&) noexcept;

}  // namespace dashpot::analysis
