#include <dashpot/analysis/design/modal_damping.hpp>
#include <dashpot/analysis/joint_ratio_damping.hpp>
#include <dashpot/analysis/linalg/semidefinite_cholesky.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Matrix = JointRatioDamping::Matrix;
using Eigen::Index;

/// Cosines between columns below this are squared by the sweep that has seen them.
constexpr double kConverged = 1e-8;
constexpr int kMaxSweeps = 16;
/// After so many updates the rotations restart, before their rounding errors add up.
constexpr int kFreshStart = 256;

/// L with M = L L', in place of the lower triangle; false unless M is positive definite.
bool cholesky(Matrix& M) noexcept {
  const Index n = M.rows();
  for (Index j = 0; j < n; ++j) {
    if (!(M(j, j) > 0)) return false;
    const double inverse = 1 / std::sqrt(M(j, j));
    for (Index i = j; i < n; ++i) M(i, j) *= inverse;
    for (Index k = j + 1; k < n; ++k) {
      for (Index i = k; i < n; ++i) M(i, k) -= M(i, j) * M(k, j);
    }
  }
  return true;
}

/// Columns of A <- L^-1 A
void solve_lower(const Matrix& L, Matrix& A) noexcept {
  const Index n = L.rows();
  for (Index c = 0; c < n; ++c) {
    for (Index j = 0; j < n; ++j) {
      A(j, c) /= L(j, j);
      for (Index i = j + 1; i < n; ++i) A(i, c) -= L(i, j) * A(j, c);
    }
  }
}

/// Columns of A <- L^-T A
void solve_upper(const Matrix& L, Matrix& A) noexcept {
  const Index n = L.rows();
  for (Index c = 0; c < n; ++c) {
    for (Index i = n - 1; i >= 0; --i) {
      double sum = A(i, c);
      for (Index j = i + 1; j < n; ++j) sum -= L(j, i) * A(j, c);
      A(i, c) = sum / L(i, i);
    }
  }
}

/// Turns columns p and q of X.
void turn(Matrix& X, Index p, Index q, double c, double s) noexcept {
  double* const left = X.data() + p * X.rows();
  double* const right = X.data() + q * X.rows();
  for (Index i = 0; i < X.rows(); ++i) {
    const double l = c * left[i] - s * right[i];
    right[i] = s * left[i] + c * right[i];
    left[i] = l;
  }
}

/// One sweep over all pairs of columns of A, with B turned alike. Returns the square of the largest
/// cosine between two columns that it met.
double sweep(Matrix& A, Matrix& B) noexcept {
  constexpr double kTiny = std::numeric_limits<double>::min();
  double worst = 0;
  for (Index p = 0; p < A.rows(); ++p) {
    for (Index q = p + 1; q < A.rows(); ++q) {
      double left = 0, right = 0, dot = 0;
      for (Index i = 0; i < A.rows(); ++i) {
        left += A(i, p) * A(i, p);
        right += A(i, q) * A(i, q);
        dot += A(i, p) * A(i, q);
      }
      const double square = dot * dot;
      worst = std::max(worst, square / (left * right + kTiny));
      if (square == 0) continue;
      // tan of the smaller angle, free of cancellation
      const double half = 0.5 * (right - left);
      const double t = dot / std::copysign(std::abs(half) + std::sqrt(half * half + square), half);
      const double c = 1 / std::sqrt(1 + t * t);
      turn(A, p, q, c, c * t);
      turn(B, p, q, c, c * t);
    }
  }
  return worst;
}

/// W' diag(d) W / (omega_i omega_j); zero where a frequency is.
Matrix modal_friction(const Matrix& W, const Vector<kMaxDof>& d,
                      const Vector<kMaxDof>& omega) noexcept {
  const Index n = W.rows();
  Matrix G(n, n);
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i <= j; ++i) {
      double sum = 0;
      for (Index k = 0; k < n; ++k) sum += W(k, i) * d[k] * W(k, j);
      const double size = omega[i] * omega[j];
      G(i, j) = G(j, i) = size > 0 ? sum / size : 0;
    }
  }
  return G;
}

/// B R B'
Matrix congruence(const Matrix& B, const Matrix& R) noexcept {
  const Index n = B.rows();
  Matrix BR = Matrix::Zero(n, n), result(n, n);
  for (Index j = 0; j < n; ++j) {
    for (Index k = 0; k < n; ++k) {
      for (Index i = 0; i < n; ++i) BR(i, j) += B(i, k) * R(k, j);
    }
  }
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i <= j; ++i) {
      double sum = 0;
      for (Index k = 0; k < n; ++k) sum += BR(i, k) * B(j, k);
      result(i, j) = result(j, i) = sum;
    }
  }
  return result;
}

}  // namespace

Status JointRatioDamping::set_stiffness(const Matrix& K) noexcept {
  if (K.rows() != K.cols()) return Status::kWrongSize;
  if (!K.allFinite()) return Status::kNotFinite;
  Matrix H;
  if (!semidefinite_cholesky(K, H)) return Status::kStiffnessIndefinite;
  factor_ = rotated_ = H;
  updates_ = 0;
  return Status::kOk;
}

Status JointRatioDamping::update(const Matrix& M, Matrix& C) noexcept {
  const Index n = factor_.rows();
  if (n == 0 || M.rows() != n || M.cols() != n) return Status::kWrongSize;
  if (friction_.size() != 0 && friction_.size() != n) return Status::kWrongSize;
  Matrix L = M;
  if (!cholesky(L)) return Status::kMassNotPositiveDefinite;
  Matrix B = updates_ < kFreshStart ? rotated_ : factor_;
  Matrix A = B;
  solve_lower(L, A);
  double worst = 1;
  for (int count = 0; !(worst <= kConverged * kConverged); ++count) {
    if (count == kMaxSweeps) return Status::kNotConverged;
    worst = sweep(A, B);
  }
  Vector<kMaxDof> omega(n);
  double fastest = 0;
  for (Index i = 0; i < n; ++i) {
    double square = 0;
    for (Index k = 0; k < n; ++k) square += A(k, i) * A(k, i);
    omega[i] = std::sqrt(square);
    if (!std::isfinite(omega[i])) return Status::kNotFinite;
    fastest = std::max(fastest, omega[i]);
  }
  Matrix R = Matrix::Zero(n, n);
  if (friction_.size() != 0) {
    solve_upper(L, A);
    R = modal_friction(A, friction_, omega);
  }
  bool overdone = false;
  const double soft = target_.soft_limit(fastest);
  const Status status = missing_damping(omega, target_, soft, R, overdone);
  if (status != Status::kOk) return status;
  C = congruence(B, R);
  overdone_ = overdone && friction_.size() != 0;
  updates_ = updates_ < kFreshStart ? updates_ + 1 : 0;
  rotated_ = B;
  return Status::kOk;
}

}  // namespace dashpot::analysis
