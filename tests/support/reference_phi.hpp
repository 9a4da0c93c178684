#pragma once
// phi_k((A - i omega I) t) with about 25 digits, by nothing but the Taylor series, scaling and
// squaring of an augmented matrix of double-doubles: slow, and far from the code under test.

#include <dashpot/analysis/linalg/double_double.hpp>

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace dashpot::testing {

/// A square matrix of double-doubles.
class ExtendedSquare {
 public:
  using Scalar = analysis::DoubleDouble;

  explicit ExtendedSquare(int n) : n_(static_cast<std::size_t>(n)), entries_(n_ * n_) {}
  int size() const { return static_cast<int>(n_); }
  Scalar& operator()(int i, int j) {
    return entries_[static_cast<std::size_t>(i) * n_ + static_cast<std::size_t>(j)];
  }
  const Scalar& operator()(int i, int j) const {
    return entries_[static_cast<std::size_t>(i) * n_ + static_cast<std::size_t>(j)];
  }
  ExtendedSquare operator*(const ExtendedSquare& other) const {
    ExtendedSquare product(size());
    for (int i = 0; i < size(); ++i) {
      for (int k = 0; k < size(); ++k) {
        if ((*this)(i, k) == Scalar(0)) continue;
        for (int j = 0; j < size(); ++j) product(i, j) += (*this)(i, k) * other(k, j);
      }
    }
    return product;
  }

 private:
  std::size_t n_;
  std::vector<Scalar> entries_;
};

/// e^Z.
inline ExtendedSquare reference_exponential(ExtendedSquare Z) {
  double norm = 0;
  for (int i = 0; i < Z.size(); ++i) {
    double sum = 0;
    for (int j = 0; j < Z.size(); ++j) sum += std::abs(Z(i, j).high);
    norm = std::max(norm, sum);
  }
  const int squarings = norm < 0.25 ? 0 : std::ilogb(norm) + 3;
  for (int i = 0; i < Z.size(); ++i) {
    for (int j = 0; j < Z.size(); ++j) Z(i, j) = Z(i, j) * std::ldexp(1.0, -squarings);
  }
  ExtendedSquare sum(Z.size());  // 1 + Z (1 + Z/2 (1 + Z/3 (...)))
  for (int i = 0; i < Z.size(); ++i) sum(i, i) = 1.0;
  for (int term = 24; term >= 1; --term) {
    const double high = 1.0 / term;
    const analysis::DoubleDouble reciprocal(high, std::fma(-high, term, 1.0) / term);
    sum = Z * sum;
    for (int i = 0; i < Z.size(); ++i) {
      for (int j = 0; j < Z.size(); ++j) sum(i, j) = sum(i, j) * reciprocal;
      sum(i, i) += 1.0;
    }
  }
  for (int i = 0; i < squarings; ++i) sum = sum * sum;
  return sum;
}

/// phi_k((A - i omega I) t), rounded to doubles. Complex numbers x + i y stand as [x -y; y x];
/// phi_k is the top right block of exp([Z I 0; 0 0 I; 0 0 0]).
inline Eigen::MatrixXcd reference_phi(int k, const Eigen::MatrixXd& A, double t, double omega = 0) {
  const int n = static_cast<int>(A.rows());
  ExtendedSquare augmented(2 * n * (k + 1));
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      augmented(i, j) = augmented(n + i, n + j) = analysis::two_product(A(i, j), t);
    }
    augmented(i, n + i) = analysis::two_product(omega, t);
    augmented(n + i, i) = analysis::two_product(-omega, t);
  }
  for (int i = 0; i < 2 * n * k; ++i) augmented(i, i + 2 * n) = 1.0;
  const ExtendedSquare exponential = reference_exponential(augmented);
  Eigen::MatrixXcd result(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      result(i, j) = {exponential(i, 2 * n * k + j).high, exponential(n + i, 2 * n * k + j).high};
    }
  }
  return result;
}

}  // namespace dashpot::testing
