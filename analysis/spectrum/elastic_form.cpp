#include <dashpot/analysis/elastic_form.hpp>
#include <dashpot/analysis/linalg/hessenberg_qr.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>

#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Index;

/// Sets `inverse` to L^-1 of the lower Cholesky factor L of M. Returns false unless M is positive
/// definite.
template <int N>
bool invert_cholesky(const Square<N>& M, Square<N>& inverse) noexcept {
  const Index n = M.rows();
  Square<N> L(n, n);
  inverse.setZero(n, n);
  for (Index j = 0; j < n; ++j) {
    for (Index i = j; i < n; ++i) {
      double rest = M(i, j);
      for (Index k = 0; k < j; ++k) rest -= L(i, k) * L(j, k);
      if (i == j && !(rest > 0)) return false;
      L(i, j) = i == j ? std::sqrt(rest) : rest / L(j, j);
    }
  }
  for (Index j = 0; j < n; ++j) {
    for (Index i = j; i < n; ++i) {
      double rest = i == j ? 1 : 0;
      for (Index k = j; k < i; ++k) rest -= L(i, k) * inverse(k, j);
      inverse(i, j) = rest / L(i, i);
    }
  }
  return true;
}

/// Reduces B to upper triangular form by Householder reflections, B = Q R, and replaces T by T Q.
template <class Matrix, class Coordinates>
void triangulate(Matrix& B, Coordinates* T) noexcept {
  const Index rows = B.rows();
  for (Index k = 0; k < std::min(B.cols(), rows - 1); ++k) {
    double* const v = &B(0, k);  // of which the entries from k on become the reflection's vector
    double square = 0;
    for (Index i = k + 1; i < rows; ++i) square += v[i] * v[i];
    if (square == 0) continue;
    const double norm = std::sqrt(v[k] * v[k] + square);
    const double alpha = v[k] > 0 ? -norm : norm;
    v[k] -= alpha;
    const double factor = 1 / (norm * std::abs(v[k]));  // 2 / |v|^2
    const auto reflect = [&](double* x) {
      double dot = 0;
      for (Index i = k; i < rows; ++i) dot += v[i] * x[i];
      dot *= factor;
      for (Index i = k; i < rows; ++i) x[i] -= dot * v[i];
    };
    for (Index j = k + 1; j < B.cols(); ++j) reflect(&B(0, j));
    for (Index i = 0; T != nullptr && i < T->rows(); ++i) {
      double dot = 0;
      for (Index j = k; j < rows; ++j) dot += (*T)(i, j) * v[j];
      dot *= factor;
      for (Index j = k; j < rows; ++j) (*T)(i, j) -= dot * v[j];
    }
    v[k] = alpha;
    for (Index i = k + 1; i < rows; ++i) v[i] = 0;
  }
}

/// 1 / |R^-1| (Frobenius) of an upper triangular matrix; zero if it is singular.
template <int N>
double least_singular_value(const Square<N>& R) noexcept {
  const Index m = R.rows();
  double sum = 0;
  Square<N> inverse = Square<N>::Zero(m, m);
  for (Index j = 0; j < m; ++j) {
    if (R(j, j) == 0) return 0;
    for (Index i = j + 1; i-- > 0;) {
      double rest = i == j ? 1 : 0;
      for (Index k = i + 1; k <= j; ++k) rest -= R(i, k) * inverse(k, j);
      inverse(i, j) = rest / R(i, i);
      sum += inverse(i, j) * inverse(i, j);
    }
  }
  return 1 / std::sqrt(sum);
}

}  // namespace

template <int N>
Status to_elastic_form(const System<N>& system, ElasticForm<N>& out) noexcept {
  const Index n = system.dof(), rows = system.stiffness_factor.rows();
  Square<N> inverse;
  if (!invert_cholesky<N>(system.mass, inverse)) return Status::kMassNotPositiveDefinite;
  out.coordinates = inverse.transpose();
  if (rows <= n) {
    const Square<N> transposed = system.stiffness_factor.transpose();
    Square<N> B;
    multiply(inverse, transposed, B);
    triangulate(B, &out.coordinates);
    out.root = B.topRows(rows);
    out.slowest = least_singular_value<N>(out.root);
  } else {
    StiffnessFactor<N> B = system.stiffness_factor.lazyProduct(out.coordinates);
    triangulate(B, static_cast<Square<N>*>(nullptr));
    out.root = B.topRows(n);
    out.slowest = least_singular_value<N>(out.root);
    out.root.transposeInPlace();
  }
  if (out.modes() == 0) out.slowest = std::numeric_limits<double>::infinity();
  const Square<N> transposed = out.coordinates.transpose();
  Square<N> half;
  multiply(system.damping, out.coordinates, half);
  multiply(transposed, half, out.damping);
  const double all = out.damping.norm(), zero = out.damping.rightCols(n - out.modes()).norm();
  constexpr double kEps = std::numeric_limits<double>::epsilon();
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
