#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/linalg/double_double.hpp>
#include <dashpot/analysis/linalg/small_dense.hpp>
#include <dashpot/analysis/system/zero_modes.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

/// Squared frequencies this far apart or less are right to half their digits straight from K.
constexpr double kWellScaled = 1e-8;
/// A correction of the null space (tangents of angles) up to which it is small enough to be one.
constexpr double kCorrection = 0.1;
/// Corrections, each smaller than the one before by about the first one, until that is rounding.
constexpr int kCorrections = 16;

template <int N>
void sort_by_magnitude(Square<N>& P, Vector<N>& values) {
  for (Eigen::Index i = 0; i + 1 < values.size(); ++i) {
    Eigen::Index largest = i;
    for (Eigen::Index j = i + 1; j < values.size(); ++j) {
      if (std::abs(values[j]) > std::abs(values[largest])) largest = j;
    }
    std::swap(values[i], values[largest]);
    if (largest != i) P.col(i).swap(P.col(largest));
  }
}

/// Right singular vectors and squared singular values of W L^-T; returns the floor, rad/s.
template <int N>
double from_factor(const StiffnessFactor<N>& W, const Square<N>& L, Square<N>& P,
                   Vector<N>& kappa) {
  const auto upper = L.template triangularView<Eigen::Lower>().transpose();
  const StiffnessFactor<N> J_hat = upper.template solve<Eigen::OnTheRight>(W);
  const Eigen::JacobiSVD<StiffnessFactor<N>> svd(J_hat, Eigen::ComputeFullV);
  P = svd.matrixV();
  kappa.head(svd.singularValues().size()) = svd.singularValues().cwiseAbs2();
  return static_cast<double>(std::max(W.rows(), W.cols())) * kEps * svd.singularValues()[0];
}

/// Cholesky factor W of a positive semidefinite K = W'W, with symmetric pivoting on K scaled to a
/// unit diagonal: rounding errors of K are then n eps in every entry, however its entries are
/// graded, and a pivot below that ends the factorisation. Returns false if K is indefinite.
template <int N>
bool factor_stiffness(const Square<N>& K, StiffnessFactor<N>& W) {
  const Eigen::Index n = K.rows();
  const Vector<N> scale = K.diagonal().cwiseAbs().cwiseSqrt();
  Square<N> A = K;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const double size = scale[i] * scale[j];
      if (size == 0 && K(i, j) != 0) return false;
      A(i, j) = size == 0 ? 0 : K(i, j) / size;
    }
  }
  const double tolerance = 8 * static_cast<double>(n) * kEps;
  W.setZero(n, n);
  Eigen::Index rank = 0;
  for (; rank < n; ++rank) {
    Eigen::Index pivot = 0;
    if (A.diagonal().minCoeff() < -tolerance) return false;
    const double largest = A.diagonal().maxCoeff(&pivot);
    if (largest <= tolerance) {
      if (A.cwiseAbs().maxCoeff() > tolerance) return false;
      W.conservativeResize(rank, n);
      return true;
    }
    const Vector<N> row = A.col(pivot) / std::sqrt(largest);
    W.row(rank) = row.cwiseProduct(scale).transpose();
    A.noalias() -= row * row.transpose();
    A.row(pivot).setZero();
    A.col(pivot).setZero();
  }
  return true;
}

/// Eigenvectors and eigenvalues of L^-1 K L^-T (singular ones if K is not symmetric).
template <int N>
double from_stiffness(const System<N>& system, const Square<N>& L, Square<N>& P, Vector<N>& kappa) {
  const auto lower = L.template triangularView<Eigen::Lower>();
  Square<N> K_hat = system.stiffness.transpose();
  lower.solveInPlace(K_hat);
  K_hat.transposeInPlace();
  lower.solveInPlace(K_hat);
  if (!K_hat.allFinite()) return std::numeric_limits<double>::infinity();
  if (system.stiffness == system.stiffness.transpose()) {
    const Eigen::SelfAdjointEigenSolver<Square<N>> eigen(K_hat);
    P = eigen.eigenvectors();
    kappa = eigen.eigenvalues();
    sort_by_magnitude<N>(P, kappa);
  } else {
    const Eigen::JacobiSVD<Square<N>> svd(K_hat, Eigen::ComputeFullV);
    P = svd.matrixV();
    kappa = svd.singularValues();
  }
  return std::sqrt(static_cast<double>(system.dof()) * kEps * std::abs(kappa[0]));
}

/// Makes the last `count` columns P0 of P = [P1 P0] the null space of L^-1 K L^-T to full accuracy.
/// A factor or the eigenvectors of K leave errors of eps kappa_1 / kappa_i along the i-th mode, by
/// which damping that leaves the zero modes alone would seem to couple them. Newton steps
/// P0 -= P1 X, X = diag(kappa)^-1 T1' K T0, [T1 T0] = L^-T P, with K T0 in double-double
/// arithmetic, low words included.
template <int N>
void polish_null_space(const System<N>& system, const Square<N>& L, const Vector<N>& kappa,
                       Eigen::Index count, Square<N>& P) {
  const Eigen::Index n = system.dof(), m = n - count;
  double first = 0;
  for (int step = 0; step < kCorrections; ++step) {
    const Square<N> T = L.template triangularView<Eigen::Lower>().transpose().solve(P);
    Square<N> residual(n, count);
    for (Eigen::Index j = 0; j < count; ++j) {
      for (Eigen::Index i = 0; i < n; ++i) {
        DotAccumulator sum;
        for (Eigen::Index k = 0; k < n; ++k) {
          sum.add(system.stiffness(i, k), T(k, m + j));
          if (system.has_low_words) sum.add(system.stiffness_low(i, k), T(k, m + j));
        }
        residual(i, j) = sum.value().high;
      }
    }
    Square<N> X = T.leftCols(m).transpose() * residual;
    for (Eigen::Index i = 0; i < m; ++i) X.row(i) /= kappa[i];
    const double size = X.norm();
    if (!(size < kCorrection)) return;
    Square<N> columns(n, n);  // P0 first: it stays where it is while the others turn with it
    columns.leftCols(count) = P.rightCols(count) - P.leftCols(m) * X;
    columns.rightCols(m) = P.leftCols(m);
    orthonormalize(columns);
    P.leftCols(m) = columns.rightCols(m);
    P.rightCols(count) = columns.leftCols(count);
    if (step == 0) first = size;
    if (!(first * size > kEps)) return;
  }
}

}  // namespace

template <int N>
ZeroModes<N> find_zero_modes(const System<N>& system, const Square<N>& L) noexcept {
  const Eigen::Index n = system.dof();
  ZeroModes<N> result;
  Square<N> P = Square<N>::Identity(n, n);
  Vector<N> kappa = Vector<N>::Zero(n);
  if (n > 0 && system.stiffness_factor.rows() > 0) {
    result.floor = from_factor<N>(system.stiffness_factor, L, P, kappa);
  } else if (n > 0) {
    result.floor = from_stiffness<N>(system, L, P, kappa);
    if (!(std::abs(kappa[n - 1]) > kWellScaled * std::abs(kappa[0])) && system.symmetric()) {
      StiffnessFactor<N> W;
      if (factor_stiffness<N>(system.stiffness, W) && W.rows() > 0) {
        kappa.setZero();
        result.floor = from_factor<N>(W, L, P, kappa);
      }
    }
  }
  result.smallest_kept = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < n; ++i) {
    const double omega = std::sqrt(std::abs(kappa[i]));
    if (omega > result.floor) {
      result.smallest_kept = omega;
    } else {
      result.largest_dropped = std::max(result.largest_dropped, omega);
      ++result.count;
      kappa[i] = 0;
    }
  }
  // A factor without low words is the exact one, and the stiffness formed from it is rounded.
  const bool exact = system.stiffness_factor.rows() == 0 || system.has_low_words;
  if (0 < result.count && result.count < n && exact &&
      system.stiffness == system.stiffness.transpose()) {
    polish_null_space<N>(system, L, kappa, result.count, P);
  }
  result.stiffness_values = kappa;
  result.coordinates = L.template triangularView<Eigen::Lower>().transpose().solve(P);
  result.basis = result.coordinates.rightCols(result.count);
  return result;
}

template ZeroModes<kDynamic> find_zero_modes(const System<kDynamic>&,
                                             const Square<kDynamic>&) noexcept;
template ZeroModes<kMaxDof> find_zero_modes(const System<kMaxDof>&,
                                            const Square<kMaxDof>&) noexcept;

}  // namespace dashpot::analysis
