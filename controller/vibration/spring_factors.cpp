#include <dashpot/controller/base/joint_algebra.hpp>
#include <dashpot/controller/vibration/spring_factors.hpp>

#include <cmath>
#include <cstring>
#include <limits>

namespace dashpot::controller {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

}  // namespace

JointMatrix semidefinite_factor(JointMatrix A) noexcept {
  const Eigen::Index n = A.rows();
  JointMatrix W = JointMatrix::Zero(n, n);
  double least = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::Index pivot = 0;
    for (Eigen::Index i = 1; i < n; ++i) {
      if (A(i, i) > A(pivot, pivot)) pivot = i;
    }
    if (k == 0) least = static_cast<double>(n) * kEpsilon * A(pivot, pivot);
    if (!(A(pivot, pivot) > least)) break;
    const double root = std::sqrt(A(pivot, pivot));
    for (Eigen::Index i = 0; i < n; ++i) W(k, i) = A(i, pivot) / root;
    for (Eigen::Index j = 0; j < n; ++j) {
      for (Eigen::Index i = 0; i < n; ++i) A(i, j) -= W(k, i) * W(k, j);
    }
    for (Eigen::Index i = 0; i < n; ++i) A(i, pivot) = A(pivot, i) = 0;
  }
  return W;
}

bool orthonormalize(const JointVector* Q, int count, double least, JointVector& y) noexcept {
  for (int pass = 0; pass < 2; ++pass) {
    for (int k = 0; k < count; ++k) add(Q[k], y, -product(Q[k], y));
  }
  const double length = std::sqrt(product(y, y));
  if (!(length > least)) return false;
  for (double& entry : y) entry /= length;
  return true;
}

bool lower_cholesky(JointMatrix& A, int n) noexcept {
  double trace = 0;
  for (int i = 0; i < n; ++i) trace += A(i, i);
  const double least = 16 * static_cast<double>(n) * kEpsilon * trace;
  for (int k = 0; k < n; ++k) {
    if (!(A(k, k) > least)) return false;
    A(k, k) = std::sqrt(A(k, k));
    for (int i = k + 1; i < n; ++i) A(i, k) /= A(k, k);
    for (int j = k + 1; j < n; ++j) {
      for (int i = j; i < n; ++i) A(i, j) -= A(i, k) * A(j, k);
    }
  }
  return true;
}

void SpringFactor::update(const double* K, int n) noexcept {
  const auto bytes = static_cast<std::size_t>(n * n) * sizeof(double);
  if (K_.rows() == n && std::memcmp(K_.data(), K, bytes) == 0) return;
  K_ = Eigen::Map<const Eigen::MatrixXd>(K, n, n);
  JointMatrix L = K_;
  if (lower_cholesky(L, n)) {
    rows_ = n;
    W_.setZero(n, n);
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i <= j; ++i) W_(i, j) = L(j, i);
    }
    return;
  }
  W_ = semidefinite_factor(K_);
  for (rows_ = 0; rows_ < n && !W_.row(rows_).isZero(0);) ++rows_;
}

void FactorRows::triangularize(int n) noexcept {
  for (int k = 0; k < n; ++k) {
    double* const x = column(k);
    double tail = 0;
    for (int i = k + 1; i < size_; ++i) tail += x[i] * x[i];
    const double norm = std::sqrt(x[k] * x[k] + tail);
    if (!(norm > 0)) continue;
    // (I - v v' / (norm |v_k|)) x = -+norm e_k, with v = x +- norm e_k away from cancellation.
    const double side = x[k] > 0 ? 1 : -1;
    const double head = x[k] + side * norm, scale = 1 / (norm * std::abs(head));
    for (int j = k + 1; j < n; ++j) {
      double* const y = column(j);
      double dot = head * y[k];
      for (int i = k + 1; i < size_; ++i) dot += x[i] * y[i];
      dot *= scale;
      y[k] = -side * (y[k] - dot * head);
      for (int i = k + 1; i < size_; ++i) y[i] -= dot * x[i];
    }
    x[k] = norm;
    for (int i = k + 1; i < size_; ++i) x[i] = 0;
  }
  size_ = n;
}

}  // namespace dashpot::controller
